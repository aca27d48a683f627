"""A wrongly wired or configured device whose stylus is released: the gate switches off before it is fast."""

from collections.abc import Callable

import numpy as np
import pytest

from controllers.safety.arming import ARM, State
from controllers.safety.faults import Fault
from models.phantom.kinematics import forward_kinematics
from sim.devices.exchange import READING_THETA
from sim.hardware.emulated import EmulatedPhantom
from sim.hardware.gated_servo import Ticker
from tests.sim.hardware.emulation import PERIOD, FaultyDriver, gated_servo

SPEED_LIMIT = 2.0
"""Largest allowed speed of the tip [m/s]: the fault's 1.5, and what 4 N add to 75 g during the filter's delay."""
SPEED_LIMIT_ENCODERS_SWAPPED = 4.0
"""The same with exchanged encoders, where the gate sees a wrong linkage and a third of the speed [m/s]."""
Wiring = Callable[[np.ndarray], np.ndarray]


class Miswired(FaultyDriver):
    """A driver whose torques or readings are altered on the way; records the true positions of the tip."""

    def __init__(self, driver: EmulatedPhantom, torque: Wiring, reading: Wiring, delay_ticks: int = 0):
        super().__init__(driver)
        self.torque, self.tamper, self.tips = (torque, lambda row: _rewire(row, reading), list[np.ndarray]())
        self._delayed = [(np.zeros(3), False)] * delay_ticks

    def write(self, torque: np.ndarray, enable: bool) -> None:
        self._delayed.append((self.torque(torque.copy()), enable))
        super().write(*self._delayed.pop(0))
        a, b, c = (float(self.driver.port.qpos[place]) for place in self.driver.port.arm_q)
        self.tips.append(np.array(forward_kinematics((a, b, c))))

    def top_speed(self) -> float:
        return float(np.linalg.norm(np.diff(self.tips, axis=0), axis=1).max()) / PERIOD


def _rewire(row: np.ndarray, wiring: Wiring) -> None:
    row[READING_THETA : READING_THETA + 3] = wiring(row[READING_THETA : READING_THETA + 3].copy())


def unchanged(values: np.ndarray) -> np.ndarray:
    return values


def signs_flipped(*joints: int) -> Wiring:
    signs = np.ones(3)
    signs[list(joints)] = -1.0
    return lambda values: signs * values


def swapped(values: np.ndarray) -> np.ndarray:
    return values[[0, 2, 1]]


def run_miswired(torque: Wiring, reading: Wiring, delay_ticks: int = 0) -> tuple[Ticker, Miswired]:
    """Four seconds from arming, with default limits and a hand that lets go once the force has ramped in."""
    driver = gated_servo(holds=1.5).driver
    assert isinstance(driver, EmulatedPhantom)
    miswired = Miswired(driver, torque, reading, delay_ticks)
    ticker = Ticker(gated_servo(miswired, dead_man=False, small=2.0))
    for k in range(4000):
        ticker.tick(k, ARM if k == 0 else -1)
        assert np.linalg.norm(ticker.gated.force) <= 4.0 + 1e-9
        assert not (ticker.fault and ticker.gated.torque.any())
    return ticker, miswired


@pytest.mark.slow
@pytest.mark.parametrize("torque", [signs_flipped(0), signs_flipped(1), signs_flipped(2), signs_flipped(0, 1, 2)])
def test_reversed_motors_are_released_with_a_fault(torque: Wiring) -> None:
    ticker, device = run_miswired(torque, unchanged)
    assert ticker.fault is not None
    assert ticker.fault.fault in (Fault.TOO_FAST, Fault.LEFT_WORKSPACE, Fault.OSCILLATION)
    assert ticker.state is State.FAULT
    assert device.top_speed() < SPEED_LIMIT


@pytest.mark.slow
@pytest.mark.parametrize(
    ("torque", "reading", "delay_ticks"),
    [(unchanged, signs_flipped(0), 0), (unchanged, signs_flipped(1), 0), (unchanged, signs_flipped(2), 0),
     (swapped, unchanged, 0), (unchanged, swapped, 0),
     (lambda torque: 3.0 * torque, unchanged, 0), (unchanged, unchanged, 20)],
    ids=["encoder 1", "encoder 2", "encoder 3", "motors swapped", "encoders swapped", "torque constant", "20 ms late"],
)  # fmt: skip
def test_tip_stays_slow_under_any_miswiring(torque: Wiring, reading: Wiring, delay_ticks: int) -> None:
    _, device = run_miswired(torque, reading, delay_ticks)
    assert device.top_speed() < (SPEED_LIMIT_ENCODERS_SWAPPED if reading is swapped else SPEED_LIMIT)
