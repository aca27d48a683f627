"""A servo whose device behind two arrays is driven by a second simulated Phantom, run tick by tick.

Faults are injected between the two, as they would occur with hardware.
"""

from collections.abc import Callable

import numpy as np

from controllers.safety.energy_tank import EnergyTank
from sim.devices.exchange import exchange
from sim.loop.channels import make_logs
from sim.loop.servo import rearm_servo, run_block
from sim.users.hand.arm import Arm
from sim.world.encoders import SILENT_PERIODS
from tests.sim.bare_servos import CUTOFF, SimulatedDriver, bare_servo, device_world, follow_program

FORCE_PRESENT = 0.02  # [N], a force above this counts as present


class ExchangeLoop:
    """A servo, the device behind two arrays, and its driver, run tick by tick; records commands and faults."""

    def __init__(
        self,
        arm: Arm | None = None,
        damping: float = 4.0,
        tank: EnergyTank | None = None,
        silent: float = SILENT_PERIODS,
    ):
        self.world = device_world()
        self.program = follow_program(damping=damping)
        self.device = exchange(self.world, CUTOFF, silent=silent)
        self.servo = bare_servo(self.world, self.device, self.program, tank=tank)
        self.driver = SimulatedDriver(self.device, arm)
        self.tick = 0
        self.force, self.torque, self.fault, self.applied = [], [], [], []

    def run(self, n: int, tamper: Callable[[], None] = lambda: None) -> None:
        """Run some ticks; `tamper` is called between the driver's reading and the servo."""
        for _ in range(n):
            if self.tick > 0:
                self.driver.write()
                self.applied.append(self.driver.torque.copy())
            self.driver.read()
            tamper()
            ticks, frames = make_logs(self.servo, 1)
            run_block(self.servo, self.tick, 1, False, ticks, frames)
            self.force.append(ticks.force[0])
            self.torque.append(ticks.torque[0])
            self.fault.append(ticks.fault[0, 0])
            self.tick += 1

    @property
    def sizes(self) -> np.ndarray:
        return np.linalg.norm(self.force, axis=1)


def assert_motors_off(loop: ExchangeLoop, since: int) -> None:
    """From a tick on a fault is latched, and force, commanded torque and motor torque are zero."""
    assert all(loop.fault[since:])
    assert not np.any(loop.force[since:])
    assert not np.any(loop.torque[since:])
    assert not np.any(loop.applied[since:])


def assert_recovers_after_rearm(loop: ExchangeLoop) -> None:
    """The force returns once the servo is rearmed, without a jump."""
    first = len(loop.force)
    rearm_servo(loop.servo)
    loop.run(150)
    assert not any(loop.fault[first:])
    assert loop.sizes[first] < 0.05
    assert loop.sizes[-1] > FORCE_PRESENT
    assert np.abs(np.diff(loop.sizes[first:])).max() < 0.3
