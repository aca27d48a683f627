"""Trials of a lifted map with a hand pushed off its curve: what the physical figure follows, and the remarks."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.room import Room
from experiments.config.options import run_config
from experiments.files.map_files import save_map
from experiments.fitting import animation_trial, hand_tours, leg_choice
from experiments.fitting.animation_trial import AnimationTrial
from experiments.fitting.hand_tours import tour_along_curve
from experiments.fitting.motion_faults import MotionFaults
from experiments.fitting.similarity import arms
from experiments.lifting.lift import lift_clips
from experiments.preparation.followed import Followed
from experiments.setups.setups import map_parts
from models.humanoid.skeleton import figure_model, rest_pose
from models.mocap.motion.clip import Clip, pose_difference


@pytest.fixture(scope="module")
def lifted() -> Lifted:
    # Narrow, so that a push reaches the clip of the other curve.
    return lift_clips(("squat_dance", "cheer"), Room((0.04, 0.06), (-0.01, 0.01))).haptic_map


def test_trial_pushes_out_and_in_with_pure_clip_between(lifted: Lifted, monkeypatch: pytest.MonkeyPatch) -> None:
    curve = lifted.curve(0)
    pushed = tour_along_curve(lifted, curve, True).poses
    monkeypatch.setattr(hand_tours, "_PUSH_OFFSET", 0.0)
    unpushed = tour_along_curve(lifted, curve, True).poses
    difference = np.abs(pose_difference(unpushed, pushed)[:, 6:]).max(axis=1)
    times = np.arange(len(pushed)) / 120.0
    assert difference[times < 1.69].max() < 1e-9
    assert difference[(times > 2.1) & (times < 4.7)].min() > 1e-3
    assert difference.max() > 0.05


def test_hand_is_late_outside_and_early_inside_without_pace_keeping() -> None:
    curve = Trajectory.circle(0.05, 4.0)
    push = np.concatenate([np.zeros(60), np.ones(120), np.zeros(60), -np.ones(120)])
    phases = hand_tours._pushed_phases(curve, push, False)  # pyright: ignore[reportPrivateUsage]
    lateness = np.arange(360) / 120.0 - phases
    assert np.abs(lateness[:61]).max() < 1e-9
    assert lateness[180] == pytest.approx(8.0 / 58.0, rel=1e-3)
    assert lateness[359] < lateness[240]


def test_push_along_a_curve_whose_radius_changes_speeds_the_hand_up_or_slows_it_down() -> None:
    """By 2.5 N over 8 N s/m times the sine of the curve's slope; on a circle the hand keeps its pace."""
    angles = np.linspace(0.0, 2.0 * np.pi, 61)
    radii = 0.05 + 0.005 * np.cos(angles)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros(61)], axis=1)
    curve = Trajectory(np.linspace(0.0, 4.0, 61), points, periodic=True)
    outwards = np.ones(60)
    for at, pace in ((1.0, 1.0 - 0.3125 * 0.0995 / 0.0789), (3.0, 1.0 + 0.3125 * 0.0995 / 0.0789)):
        begun = Trajectory(
            curve.times + at, np.roll(points[:-1], -round(15 * at), axis=0)[[*range(60), 0]], periodic=True
        )
        phases = hand_tours._pushed_phases(begun, outwards, True)  # pyright: ignore[reportPrivateUsage]
        assert 120.0 * phases[1] == pytest.approx(pace, abs=0.01)
    kept = hand_tours._pushed_phases(Trajectory.circle(0.05, 4.0), outwards, True)  # pyright: ignore[reportPrivateUsage]
    assert kept == pytest.approx(np.arange(60) / 120.0, abs=1e-6)


FALLS, LACKS = Followed(0.2, 3.0), Followed(0.2)
WHOLE_MAP_REMARK = "pushed off its curve to those beside it, the physical figure {} with the whole map"


@pytest.mark.parametrize(
    ("results", "legs", "share", "expected"),
    [
        ({"whole": Followed(0.11)}, None, 1.0, ()),
        (
            {"whole": LACKS, 1.0: Followed(0.07), 0.5: Followed(0.068), 0.25: Followed(0.069),
             0.0: Followed(0.069)},
            1, 1.0, (WHOLE_MAP_REMARK.format("has a residual of 20 % of weight"),),
        ),
        ({"whole": FALLS, 1.0: Followed(0.05)}, 1, 1.0, (WHOLE_MAP_REMARK.format("falls at 3.0 s"),)),
        (
            {"whole": LACKS, 1.0: Followed(0.1), 0.5: Followed(0.06)},
            1, 0.5, (WHOLE_MAP_REMARK.format("has a residual of 20 % of weight"),),
        ),
        (
            {"whole": FALLS, 1.0: Followed(0.09), 0.5: Followed(0.08), 0.25: Followed(0.1),
             0.0: Followed(0.1)},
            1, 0.5, (WHOLE_MAP_REMARK.format("falls at 3.0 s"),),
        ),
        (
            {"whole": FALLS, 1.0: Followed(0.3, 2.0), 0.5: LACKS, 0.25: FALLS, 0.0: LACKS},
            1, 0.5, (f"{WHOLE_MAP_REMARK.format('falls at 3.0 s')}, and has a residual of 20 % of weight "
                     "with the best part of it",),
        ),
    ],
)  # fmt: skip
def test_figure_keeps_own_legs_and_the_largest_bearable_arm_share(
    results: dict[str | float, Followed], legs: int | None, share: float, expected: tuple[str, ...], lifted: Lifted,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def tried(trial: AnimationTrial) -> Followed:
        part = cast(Lifted, trial.show())
        return results["whole" if part.legs_of is None else part.share]

    monkeypatch.setattr(leg_choice, "tour_along_curve", lambda part, curve, keeps_pace: part)
    monkeypatch.setattr(AnimationTrial, "followed", tried)
    monkeypatch.setattr(AnimationTrial, "is_sound", lambda *_, **__: True)
    part, remarks = leg_choice.followed_map(lifted, lifted.curve(1), 1, arms(lifted.limbs), True)
    assert (part.legs_of, part.share, remarks) == (legs, share, expected)


def test_figure_keeps_own_legs_if_whole_map_skates(lifted: Lifted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leg_choice, "tour_along_curve", lambda part, curve, keeps_pace: part)
    monkeypatch.setattr(AnimationTrial, "followed", lambda *_: Followed(0.01))
    monkeypatch.setattr(AnimationTrial, "is_sound", lambda *_, **__: False)
    part, remarks = leg_choice.followed_map(lifted, lifted.curve(1), 1, arms(lifted.limbs), True)
    assert (part.legs_of, part.share) == (1, 1.0)
    assert "feet skate" in remarks[0]


def test_legs_of_pushed_figure_equal_its_own_clip(lifted: Lifted) -> None:
    curve = lifted.curve(1)
    with_arms = lifted.with_legs_of(1, arms(lifted.limbs), 1.0)
    without_arms = lifted.with_legs_of(1, arms(lifted.limbs), 0.0)
    pushed, own = (tour_along_curve(part, curve, True).poses for part in (with_arms, without_arms))
    difference = np.abs(pose_difference(pushed, own))
    upper = [6 + 3 * (joint - 1) + axis for joint in arms(lifted.limbs) for axis in range(3)]
    assert difference[:, upper].max() > 0.01
    assert np.delete(difference, upper, axis=1).max() < 1e-6


def test_curve_of_lifted_map_has_the_duration_of_its_clip(lifted: Lifted, tmp_path: Path) -> None:
    save_map(lifted, tmp_path / "map.npz")
    parts = map_parts(run_config(map=str(tmp_path / "map.npz"), curve="cheer"), figure_model())
    assert parts.lap_seconds == parts.curve.duration == pytest.approx(lifted.curve(1).duration)
    assert lifted.lap_seconds != pytest.approx(lifted.curve(1).duration, rel=0.01)


def test_one_stance_of_many_in_which_a_push_drags_a_foot_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pushes come once a lap; the measure of a map's animation otherwise leaves out a twentieth of the stances."""
    still = Clip(np.repeat(rest_pose()[None], 4, axis=0), 120.0, "still")
    monkeypatch.setattr(animation_trial, "motion_faults", lambda *_: MotionFaults(0.0, 0.0, 0.01, 0.06))
    trial = AnimationTrial(__name__, lambda: still, 1.0, (np.random.default_rng().random(8),))
    assert trial.is_sound()
    assert not trial.is_sound(in_every_stance=True)
