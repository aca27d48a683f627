"""Fast and slow rivers hold a hand despite encoder noise; default pushes switch rivers without chatter."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from experiments.config.modes import Rivers
from experiments.config.options import run_config
from experiments.setups.modes.rivers import LEAST_HYSTERESIS, default_choice
from experiments.setups.parts.hands import RIVER_PUSH, river_pushes
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from sim.loop.loop import Loop

RADIUS = 0.0477


def river_at_each_tick(lap: float, user: str, seconds: float, **more: str) -> np.ndarray:
    """River of the hand on the simulated Phantom at each tick; -1 for none."""
    words = {"map": "rivers", "figure": "none", "clips": ("walk",), "lap": lap, "seed": 3, **more}
    session = wire(run_config(mode="rivers", user=user, seconds=seconds, **words))
    log = TrialLog(session.servo, session.world)
    Loop(session.servo, session.world, log).run(seconds)
    return log.ticks["river"]


def test_relaxed_hand_stays_on_a_slow_river() -> None:
    np.testing.assert_array_equal(river_at_each_tick(14.0, "relaxed", 4.0), 0.0)


@pytest.mark.parametrize("lap", [1.5, 4.0, 9.0, 12.5])
def test_default_push_switches_rivers_without_chatter_at_any_speed(lap: float) -> None:
    rivers = river_at_each_tick(lap, "push", lap)
    changes = rivers[1:][np.diff(rivers) != 0.0].tolist()
    assert changes in ([1.0], [1.0, 2.0])


def test_changing_person_switches_to_the_nearest_river() -> None:
    rivers = river_at_each_tick(4.0, "change", 8.0, person="median")
    assert rivers[0] == 0.0
    assert rivers[-1] == 1.0
    assert np.mean(rivers < 0.0) < 0.02


def test_push_force_and_duration_scale_with_lap_and_vanish_if_slow() -> None:
    laps = (2.0, 4.0, 8.0, 14.0)
    faster, at_default, slower, slowest = (river_pushes(Trajectory.circle(RADIUS, lap), 30.0) for lap in laps)
    assert (faster[0].seconds, faster[0].force) == pytest.approx((0.15, 2.0 * RIVER_PUSH), rel=1e-3)
    assert (at_default[0].seconds, at_default[0].force) == pytest.approx((0.3, RIVER_PUSH), rel=1e-3)
    assert (slower[0].seconds, slower[0].force) == pytest.approx((0.6, RIVER_PUSH / 2.0**0.2), rel=1e-3)
    assert slowest == ()


@pytest.mark.parametrize(("lap", "margin"), [(2.0, 0.15 * 0.15), (4.0, 0.15 * 0.075), (12.0, LEAST_HYSTERESIS)])
def test_hysteresis_is_a_share_of_speed_above_encoder_noise(lap: float, margin: float) -> None:
    choice = default_choice(Rivers(), Trajectory.circle(RADIUS, lap), 0.025)
    assert choice.hysteresis == pytest.approx(margin, rel=2e-3)


@pytest.mark.parametrize("name", ["rivers", "cylindrical"])
def test_rivers_too_slow_for_pushes_are_reported(name: str) -> None:
    def remarks_on_speed(lap: float) -> list[str]:
        config = run_config(mode="rivers", map=name, figure="none", clips=("walk",), lap=lap)
        return [remark for remark in wire(config).remarks if "mm/s" in remark]

    (slow,) = remarks_on_speed(21.0)
    assert slow.startswith("the rivers lead the hand at 14.3 mm/s")
    assert not remarks_on_speed(8.0)
