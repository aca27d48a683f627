"""The default hand of STRETCHY TUBES on laps longer than 4 s: the figure has to follow it, and bends are as wide."""

from typing import cast

import pytest

from experiments.config.modes import StretchyTube
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.setups.modes.stretch import stretch_grabs
from experiments.setups.session import Session
from experiments.setups.wiring import wire


def session_of(lap: float) -> Session:
    return wire(run_config(mode="stretch", figure="none", lap=lap))


def bump_of(session: Session) -> float:
    mode = cast(RunConfig, session.config).mode
    assert isinstance(mode, StretchyTube)
    assert mode.bump is not None
    return mode.bump


@pytest.mark.parametrize("lap", [4.0, 9.0, 24.0])
def test_hand_goes_to_its_places_at_the_pace_of_the_curve(lap: float) -> None:
    curve = session_of(lap).curve
    first = stretch_grabs(curve, 0.008)[0]
    greatest = 1.875 * 0.25 * curve.length / first.reach  # of a movement of minimum jerk through a quarter of the lap
    assert greatest <= 1.05 * curve.length / curve.duration


def test_bend_is_as_wide_on_any_long_lap_and_no_narrower_in_time_than_on_one_of_four_seconds() -> None:
    assert bump_of(session_of(4.0)) == 0.5
    assert bump_of(session_of(3.0)) == 0.5
    assert bump_of(session_of(24.0)) == pytest.approx(3.0)


def test_bends_after_the_end_are_reported() -> None:
    late = "the curve is bent until"
    assert not any(late in remark for remark in session_of(4.0).remarks)
    assert any(late in remark for remark in session_of(24.0).remarks)
