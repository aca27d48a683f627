"""Simulated time held to the wall clock."""

import time

import pytest

from sim.viewer.shown import RealTime


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A wall clock that only `sleep` and the test advance."""
    now = [100.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", sleep)
    return now


def test_fast_simulation_waits_for_the_wall_clock(wall: list[float]) -> None:
    clock = RealTime()
    for k in range(5):
        clock.wait_until(0.1 * k)
    assert wall[0] == pytest.approx(100.4)


def test_late_simulation_neither_waits_nor_catches_up(wall: list[float]) -> None:
    clock = RealTime()
    clock.wait_until(0.0)
    wall[0] += 3.0
    clock.wait_until(0.1)
    assert wall[0] == pytest.approx(103.0)
    clock.wait_until(0.2)
    assert wall[0] == pytest.approx(103.1)
