"""The choice of the clip whose legs carry the arms of the others, by trials of the physical figure."""

from collections.abc import Sequence
from typing import cast

import numpy as np
import pytest

from controllers.haptic_map.cylindrical import Cylindrical, LegsOfOneClip
from experiments.fitting import hand_tours, leg_choice
from experiments.fitting.animation_trial import AnimationTrial
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.hand_tours import tour_of_domain
from experiments.fitting.leg_choice import select_legs, trial_of
from experiments.fitting.similarity import arms
from experiments.preparation.followed import Followed
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded

R, Z, LAP = (0.0227, 0.0727), (-0.025, 0.025), 4.4
LEGS = figure_legs(figure_model())
NAMES = ("run", "walk", "cheer", "angry")


@pytest.fixture(scope="module")
def maps() -> list[Cylindrical]:
    motions = [(clip.poses, clip.fps) for clip in map(embedded, NAMES)]
    return [Cylindrical(motions, R, Z, LEGS, None, LAP, LegsOfOneClip(owner, arms(LEGS))) for owner in range(4)]


def set_results(
    monkeypatch: pytest.MonkeyPatch, results: dict[tuple[int, float], Followed], fit: set[int],
    alone: Sequence[tuple[int, float]] = (),
) -> list[object]:  # fmt: skip
    """Replace trials by results per (clip of the legs, share of other arms); the list of trials.

    `alone` are those that stand while the hand is left alone.
    """
    trials: list[object] = []

    def followed(trial: AnimationTrial) -> Followed:
        haptic_map = cast(Cylindrical, trial.show())
        trials.append((haptic_map.legs_of, haptic_map.share))
        return results.get((haptic_map.legs_of, haptic_map.share), Followed(0.5, 1.0))

    monkeypatch.setattr(leg_choice, "tour_of_domain", lambda haptic_map, *_: haptic_map)
    monkeypatch.setattr(
        leg_choice, "stands_left_alone", lambda haptic_map, _: (haptic_map.legs_of, haptic_map.share) in alone
    )
    monkeypatch.setattr(AnimationTrial, "followed", followed)
    monkeypatch.setattr(AnimationTrial, "is_sound", lambda trial: trial.show().legs_of in fit)
    return trials


def test_first_well_bearing_legs_are_chosen(maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch) -> None:
    results = {(0, 1.0): Followed(0.01, 3.0), (1, 1.0): Followed(0.05), (3, 1.0): Followed(0.01)}
    trials = set_results(monkeypatch, results, {0, 1, 2, 3})
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share, remarks) == (1, 1.0, ())
    assert trials == [(0, 1.0), (1, 1.0)]


def test_legs_with_least_residual_are_chosen_if_none_bear_well(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    results = {(0, 1.0): Followed(0.01, 3.0), (1, 1.0): Followed(0.11), (3, 1.0): Followed(0.08)}
    trials = set_results(monkeypatch, results, {0, 1, 2, 3})
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share, remarks) == (3, 1.0, ())
    assert trials == [(owner, 1.0) for owner in range(4)]


def test_arm_share_is_reduced_if_no_legs_bear_all_of_it(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    set_results(monkeypatch, {(1, 1.0): Followed(0.2), (2, 0.25): Followed(0.08)}, {0, 1, 2, 3})
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share, remarks) == (2, 0.25, ())


@pytest.mark.parametrize(("half", "chosen"), [(0.09, (2, 0.5)), (0.112, (1, 1.0))])
def test_arm_share_is_reduced_near_the_bound_if_that_gains_something_but_not_to_zero(
    half: float, chosen: tuple[int, float], maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of hands that push a map with 11.5 % in the trial, one in five makes the figure fall."""
    results = {(1, 1.0): Followed(0.115), (2, 0.5): Followed(half), (1, 0.0): Followed(0.02)}
    set_results(monkeypatch, results, {0, 1, 2, 3})
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share, remarks) == (*chosen, ())


def test_sliding_legs_are_chosen_only_as_a_last_resort(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    results = {(0, 1.0): Followed(0.01), (1, 0.0): Followed(0.06)}
    set_results(monkeypatch, results, {1, 2, 3})
    assert select_legs(maps.__getitem__, NAMES, LAP, False)[0].legs_of == 1
    set_results(monkeypatch, {(0, 1.0): Followed(0.01)}, {1, 2, 3})
    assert select_legs(maps.__getitem__, NAMES, LAP, False)[0].legs_of == 0


def test_unbearable_map_is_reported_with_the_best_legs(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    set_results(monkeypatch, {(2, 0.5): Followed(0.4, 9.0)}, {0, 1, 2, 3})
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share) == (2, 0.5)
    assert remarks == ("the physical figure falls at 9.0 s with the legs of cheer, the best found at this lap",)
    set_results(monkeypatch, {(1, 0.0): Followed(0.14)}, set())
    assert select_legs(maps.__getitem__, NAMES, LAP, False)[1][0].startswith(
        "the physical figure has a residual of 14 % of weight with the legs of walk"
    )


def test_legs_that_stand_while_the_hand_is_left_alone_are_chosen_if_all_fall_when_it_pushes(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hopscotch at 1.7 times its pace fell later in a push than a jog at its own, which stands without pushes."""
    results = {(0, 1.0): Followed(0.3, 5.5), (1, 1.0): Followed(0.2, 4.8), (1, 0.0): Followed(0.1, 4.7)}
    set_results(monkeypatch, results, {0, 1, 2, 3}, alone=[(1, 0.0), (2, 0.0)])
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share) == (1, 0.0)
    assert remarks == ("pushed, the physical figure falls at 4.7 s with the legs of walk; left alone it stands",)
    set_results(monkeypatch, results, {0, 1, 2, 3}, alone=[(0, 1.0), (1, 0.0)])
    best, remarks = select_legs(maps.__getitem__, NAMES, LAP, False)
    assert (best.legs_of, best.share) == (0, 1.0)
    assert remarks[0].endswith("with the legs of run, the best found at this lap; left alone it stands")


def test_legs_that_no_push_fells_are_kept_though_others_need_less_when_the_hand_is_left_alone(
    maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    set_results(monkeypatch, {(0, 1.0): Followed(0.14)}, {0, 1, 2, 3}, alone=[(1, 1.0)])
    assert select_legs(maps.__getitem__, NAMES, LAP, False)[0].legs_of == 0


def toured(haptic_map: Cylindrical, lap: float, parallel: bool, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """Coordinates (3, n) of the hand of a trial."""
    places: list[np.ndarray] = []

    def record_points(_: Cylindrical, points: np.ndarray) -> np.ndarray:
        places.append(points)
        return np.tile(embedded("walk").poses[0], (len(points), 1))

    monkeypatch.setattr(hand_tours, "map_poses", record_points)
    tour_of_domain(haptic_map, lap, parallel)
    return places[0][:, :3].T


@pytest.mark.parametrize(("parallel", "paces"), [(False, (1.0 / 1.178, 1.0 / 0.822)), (True, (1.0, 1.0))])
def test_trial_hand_covers_the_whole_map(
    parallel: bool, paces: tuple[float, float], maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    x, y, z = toured(maps[1], LAP, parallel, monkeypatch)
    r, angle = np.hypot(x, y), np.unwrap(np.arctan2(y, x))
    assert r[0] == pytest.approx(np.mean(R), abs=1e-6)
    for far, high in ((0, 0), (1, 0), (0, 1), (1, 1)):
        assert np.hypot(r - R[far], z - Z[high]).min() < 0.01  # of 50 mm
    pace = np.diff(angle) * 120.0 * LAP / (2.0 * np.pi)
    assert (pace.min(), pace.max()) == pytest.approx(paces, abs=0.01)
    assert np.median(pace) == pytest.approx(1.0, abs=0.05) or np.mean(pace) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("lap", [10.6, 13.6, 22.4, 30.0])
def test_trial_of_a_long_lap_meets_each_part_with_a_push_outwards_and_inwards(
    lap: float, maps: list[Cylindrical], monkeypatch: pytest.MonkeyPatch
) -> None:
    x, y, _ = toured(maps[1], lap, False, monkeypatch)
    turns = np.unwrap(np.arctan2(y, x)) / (2.0 * np.pi)
    pace, part = np.diff(turns) * 120.0 * lap, (turns[:-1] * 40.0).astype(int) % 40
    met = [pace[part == k].min() < 0.9 and pace[part == k].max() > 1.1 for k in range(40)]
    assert np.mean(met) > 0.8  # but where one push follows the other


@pytest.mark.parametrize(("lap", "seconds"), [(LAP, 20.0), (30.0, 60.0)])
def test_trial_takes_two_laps(lap: float, seconds: float, maps: list[Cylindrical]) -> None:
    trial = trial_of(maps[1], lap, False)
    assert trial.seconds == seconds
    assert trial.show().duration > seconds


@pytest.mark.slow
def test_walk_bears_arms_that_make_a_run_fall(maps: list[Cylindrical]) -> None:
    assert trial_of(maps[1], LAP, False).is_sound()
    walk, run = trial_of(maps[1], LAP, False).followed(), trial_of(maps[0], LAP, False).followed()
    assert walk.stands
    assert walk.is_better(run, 0.0)
    assert not run.stands
