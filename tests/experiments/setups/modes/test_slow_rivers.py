"""Rivers that long clips make slow hold a hand in spite of the encoders' noise, and are crossed by pushes that fit."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from experiments.config.words import run_config
from experiments.setups.modes.rivers import LOOK, UNFILTERED, look_of
from experiments.setups.parts.hands import RIVER_PUSH, river_pushes
from experiments.setups.wiring import wire
from experiments.trials.trial.trial_log import TrialLog
from sim.loop.loop import Loop

RADIUS = 0.0477


def rivers_of_a_hand(lap: float, user: str, seconds: float) -> np.ndarray:
    """River that has the hand of the simulated Phantom, at each tick; -1 for none."""
    words = {"map": "rivers", "figure": "none", "clips": ("walk",), "lap": lap, "seed": 3}
    session = wire(run_config(mode="rivers", user=user, seconds=seconds, **words))
    log = TrialLog(session.servo, session.world)
    Loop(session.servo, session.world, log).run(seconds)
    return log.ticks["river"]


def test_a_relaxed_hand_stays_on_a_slow_river() -> None:
    np.testing.assert_array_equal(rivers_of_a_hand(14.0, "relaxed", 4.0), 0.0)


@pytest.mark.parametrize("lap", [6.0, 9.0])
def test_the_default_push_takes_a_hand_over_into_another_river_on_slower_laps(lap: float) -> None:
    rivers = rivers_of_a_hand(lap, "push", lap)
    assert rivers[0] == 0.0
    assert rivers[-1] > 0.0
    assert rivers.min() >= 0.0


def test_pushes_across_are_as_measured_at_the_default_lap_and_none_below_what_was_found() -> None:
    at_default, slower, slowest = (river_pushes(Trajectory.circle(RADIUS, lap), 30.0) for lap in (4.0, 8.0, 14.0))
    assert (at_default[0].seconds, at_default[0].force) == (0.3, RIVER_PUSH)
    assert (slower[0].seconds, slower[0].force) == pytest.approx((0.6, RIVER_PUSH / np.sqrt(2.0)), rel=1e-3)
    assert slowest == ()


def test_the_velocity_that_selects_a_river_is_filtered_where_noise_counts() -> None:
    assert look_of("discrete", 0.0749) == 0.0
    assert look_of("discrete", 0.99 * UNFILTERED) == look_of("smooth", 0.0749) == LOOK


@pytest.mark.parametrize("name", ["rivers", "cylindrical"])
def test_rivers_too_slow_for_pushes_are_said_before_the_run(name: str) -> None:
    def said(lap: float) -> list[str]:
        config = run_config(mode="rivers", map=name, figure="none", clips=("walk",), lap=lap)
        return [remark for remark in wire(config).remarks if "mm/s" in remark]

    (slow,) = said(21.0)
    assert slow.startswith("the rivers lead the hand at 14.3 mm/s")
    assert not said(8.0)
