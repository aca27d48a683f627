"""FOLLOW on a device of the HID protocol, and in the pure simulation."""

import numpy as np

from controllers.safety.arming import ARM
from controllers.safety.faults import FAULT_RAMP
from sim.devices.driver import Driver
from sim.devices.exchange import exchange
from sim.hardware.gated_servo import Ticker
from sim.loop.channels import tick_channels
from sim.loop.loop import Loop
from tests.devices.rig import Rig
from tests.sim.bare_servos import CUTOFF, bare_servo, device_world, run, simulated
from tests.sim.hardware.emulation import UNRAMPED_GATE, gated_servo
from tests.sim.hardware.emulation import run as run_ticks

LAP = 4.0  # s


def simulated_follow() -> np.ndarray:
    """Stylus positions of the pure simulation [m], one row per tick; the force is ramped in as on a real device."""
    world = device_world()
    device = simulated(world)
    device.faults[FAULT_RAMP] = 0.0
    ticks, _ = run(bare_servo(world, device), round(LAP * 1e3))
    return ticks.hand[:, 1:4]


def device_follow(make_rig) -> tuple[np.ndarray, Rig]:
    """Stylus positions of a device, and its rig, which `make_rig` makes for an exchange."""
    world = device_world()
    device = exchange(world, CUTOFF)
    rig = make_rig(device)
    blocks = []

    def append_block(ticks, frames, n):
        blocks.append(tick_channels(ticks, n)["p"].copy())

    Loop(bare_servo(world, device), world, append_block, before_tick=rig).run(LAP)
    return np.concatenate(blocks), rig


def gated_follow(driver: Driver) -> dict[str, np.ndarray]:
    """Rows of a gated servo that guides a device in lock-step."""
    rows = run_ticks(Ticker(gated_servo(driver, dead_man=False, **UNRAMPED_GATE)), round(LAP * 1e3), request=ARM)
    assert not rows["fault"].any()
    return rows


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1))))
