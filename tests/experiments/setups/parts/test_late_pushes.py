"""Remarks on the actions of a simulated hand."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.safety.limiter import ForceLimiter, force_ceiling
from experiments.config.run_config import User
from experiments.setups.parts.hands import lap_pushes, late_remark, resolved_user
from sim.users.hand.actions import Push, Turn


@pytest.mark.parametrize(
    ("at", "remarks"),
    [
        ((), ()),
        ((4.7, 7.0), ()),
        ((7.0, 5.0), ("the first push has its peak at 5.25 s, after the run's end; give --seconds more than that",)),
        ((4.9,), ("the first push has its peak at 5.15 s, after the run's end; give --seconds more than that",)),
    ],
)
def test_pushes_whose_peaks_all_lie_past_the_end_are_reported(at: tuple[float, ...], remarks: tuple[str, ...]) -> None:
    user = User(does="push", pushes=tuple(Push(start, 0.5, 2.0) for start in at))
    assert late_remark(user, 5.0) == remarks


@pytest.mark.parametrize("lap", [4.0, 15.0, 17.0, 24.0, 60.0])
@pytest.mark.parametrize("does", ["push", "turn"])
def test_a_hand_acts_within_the_run_however_long_the_lap(does: str, lap: float) -> None:
    user = resolved_user(User(does=does), Trajectory.circle(0.05, lap), 20.0)  # pyright: ignore[reportArgumentType]
    assert late_remark(user, 20.0) == ()
    first = (user.pushes + user.turns)[0].at
    assert first == pytest.approx(lap + (0.1 * lap if does == "push" else 0.0)) or lap > 15.0


@pytest.mark.parametrize("lap", [4.0, 20.0, 40.0, 80.0])
def test_motors_can_hold_a_hand_that_pushes(lap: float) -> None:
    limiter, period, heat = ForceLimiter(0.01), 0.01, 0.0
    pushes = [push for k in range(3) for push in lap_pushes(k * lap, lap)]
    for t in np.arange(0.0, 3.0 * lap, period):
        phases = [(t - push.at) / push.seconds for push in pushes]
        force = sum(
            abs(push.force) * np.sin(np.pi * phase) ** 2
            for push, phase in zip(pushes, phases, strict=True)
            if 0.0 < phase < 1.0
        )
        assert force_ceiling.py_func(heat, limiter.continuous, limiter.peak) > force + 1.5
        heat += (force**2 - heat) * period / limiter.thermal_time


def test_a_turn_past_the_end_is_reported() -> None:
    turns = (Turn(4.0, 2.0, 0.7, (0.0, 0.0, 1.0)),)
    assert "the first turn has its peak at 5 s" in late_remark(User(does="turn", turns=turns), 5.0)[0]
    assert late_remark(User(does="turn", turns=turns), 6.0) == ()
