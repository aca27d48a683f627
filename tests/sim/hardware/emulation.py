"""Gated servos of an emulated Phantom and a FOLLOW field without clips."""

import numpy as np

from controllers.safety.arming import ARM, NO_REQUEST
from controllers.safety.faults import Fault
from controllers.safety.gate import Gate
from models.world.scene import SceneConfig
from sim.devices.driver import DriverFault
from sim.devices.exchange import READING_CLOCK, READING_THETA, exchange
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.gated_servo import GatedServo, Ticker, columns
from sim.users.hand.arm import Arm
from sim.world.linkage import Linkage
from tests.sim.bare_servos import CUTOFF, START, bare_servo, device_world, follow_program

PERIOD = 1e-3
UNRAMPED_GATE = {"ramp": PERIOD, "quiet": PERIOD, "small": 10.0, "force": 8.5, "slew": 5000.0}


def gated_servo(driver=None, linkage: Linkage | None = None, arm: Arm | None = None, program=None, holds: float = 0.0,
                period: float = PERIOD, **gate) -> GatedServo:  # fmt: skip
    world = device_world(SceneConfig(servo_period=period, physics_step=period))
    servo = bare_servo(world, exchange(world, CUTOFF), program=program or follow_program())
    driver = driver or EmulatedPhantom(SceneConfig(servo_period=period), START, linkage, arm, holds)
    return GatedServo(servo, world, driver, Gate(period, **({"permitted": True} | gate)), np.zeros(3))


def run(ticker: Ticker, n: int, first: int = 0, request: int = NO_REQUEST) -> dict[str, np.ndarray]:
    rows = []
    for k in range(n):
        ticker.tick(first + k, request if k == 0 else NO_REQUEST)
        rows.append(ticker.row.copy())
    return columns(np.array(rows))


def activate(ticker: Ticker, n: int = 150) -> int:
    run(ticker, n, request=ARM)
    return n


class FaultyDriver:
    """A driver that injects faults: `read` and `write` are passed on until one is set."""

    def __init__(self, driver: EmulatedPhantom):
        self.driver, self.identity, self.telemetry = driver, driver.identity, driver.telemetry
        self.read_fault = self.write_fault = None
        self.tamper = lambda reading: None
        self.silent, self.let_go_calls, self.last = 0, 0, np.zeros(3)

    def read(self, reading, timeout) -> bool:
        if self.read_fault is not None:
            raise DriverFault(*self.read_fault)
        if self.silent:
            self.silent -= 1
            return False
        new = self.driver.read(reading, timeout)
        self.tamper(reading)
        return new

    def write(self, torque, enable) -> None:
        if self.write_fault is not None:
            raise DriverFault(*self.write_fault)
        self.last[:] = torque if enable else 0.0
        self.driver.write(torque, enable)

    def let_go(self) -> None:
        self.let_go_calls += 1
        self.driver.let_go()

    def close(self) -> None:
        self.driver.close()


def overwrite(index: int, value: float):
    def tamper(reading) -> None:
        reading[index] = value

    return tamper


def jump_joint(axis: int):
    def tamper(reading) -> None:
        reading[READING_THETA + axis] += 0.4

    return tamper


def clock_back(reading) -> None:
    reading[READING_CLOCK] -= 3.0


READING_INDICES = (READING_CLOCK, *range(READING_THETA, READING_THETA + 6))
DRIVER_FAULTS = (
    (Fault.UNPLUGGED, 0.0), (Fault.CHECKSUM_WRONG, 3.0), (Fault.SEQUENCE_BACK, 2.0), (Fault.OVER_TEMPERATURE, 95.0),
    (Fault.DEVICE_RESET, 0.0), (Fault.VERSION_WRONG, 9.0), (Fault.REPORT_MALFORMED, 63.0), (Fault.DEVICE_REPORTED, 7.0),
)  # fmt: skip
