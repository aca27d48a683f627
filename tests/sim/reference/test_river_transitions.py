"""Transitions between the clips of rivers: continuous pose and velocity, stepping feet, reproducible."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from controllers.legs.sole_heights import SWING_HEIGHT
from controllers.state import stylus_path
from experiments.fitting.figure_legs import figure_legs, packed_legs
from experiments.fitting.rest_phases import with_rests
from experiments.setups.modes.rivers import river_bundle
from experiments.setups.parts.clips import load_clips
from experiments.studies.change_trials import (
    BLEND,
    LAP,
    PERIOD,
    drawn_changes,
    measured_change,
    played_change,
    rivers_that_play,
)
from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS, figure_model
from models.mocap.dynamics.zero_moment_point import nearest_supported
from models.mocap.motion.clip import pose_difference
from models.mocap.motion.kinematics import sole_points
from sim.reference.reference import make_reference, reference_along
from sim.reference.transition import DWELL_TIME
from tests.sim.gliding_hand import gliding_hand

GOLDEN = Path(__file__).parents[2] / "golden" / "river_clips.csv"
FIGURE = figure_model()
CURVES = [river.curve for river in river_bundle(Trajectory.circle(0.0477, LAP), 0.025, 0.02, 4.0, 0.015).rivers]
CHANGES = ((1.4, 1), (2.9, 2), (4.3, 0), (5.8, 2))


@pytest.fixture(scope="module")
def clips_of_rivers() -> RiverClips:
    clips = [(clip.poses, clip.fps) for clip in load_clips(("squat_dance", "walk", "angry"))[0]]
    return RiverClips(CURVES, clips, 0.015, figure_legs(FIGURE))


def _played(clips: RiverClips, blend: float, without_river_between: bool = False) -> np.ndarray:
    """Poses of a hand that glides from river to river, every 8 ms for 7.2 s."""
    t = np.arange(900) * PERIOD
    stylus, traces = gliding_hand(CURVES, LAP, CHANGES, t)
    for moment, _ in CHANGES if without_river_between else ():
        traces[(t >= moment - 0.1) & (t < moment), TRACE_RIVER] = -1.0
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, blend, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus, traces, poses)
    return poses


def _at_changes(values: np.ndarray) -> np.ndarray:
    """Largest value in the rows from three before to three after each change."""
    rows = [round((moment + DWELL_TIME) / PERIOD) for moment, _ in CHANGES]
    return np.array([values[k - 3 : k + 3].max() for k in rows])


def _rates(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest rate of a joint [rad/s] and of the root [m/s], each step."""
    rate = np.abs(pose_difference(poses[:-1], poses[1:])) / PERIOD
    return rate[:, 6:].max(axis=1), rate[:, :3].max(axis=1)


def test_pose_and_velocity_are_continuous_only_with_inertialisation(clips_of_rivers) -> None:
    joint, root = _rates(_played(clips_of_rivers, BLEND))
    jumping_joint, jumping_root = _rates(_played(clips_of_rivers, 0.0))
    # Within the range of the clips themselves.
    assert _at_changes(joint).max() < 12.0
    assert _at_changes(root).max() < 2.0
    assert _at_changes(jumping_joint).min() > 60.0
    poses = _played(clips_of_rivers, BLEND)
    velocity = pose_difference(poses[:-1], poses[1:]) / PERIOD
    jump = np.abs(np.diff(velocity, axis=0)).max(axis=1)
    velocity = pose_difference(*(p for p in (_played(clips_of_rivers, 0.0)[:-1], _played(clips_of_rivers, 0.0)[1:])))
    control = np.abs(np.diff(velocity / PERIOD, axis=0)).max(axis=1)
    assert _at_changes(jump).max() < 5.0
    assert _at_changes(control).min() > 60.0
    assert jumping_root.max() > root.max()


def test_figure_continues_from_its_place_on_the_floor(clips_of_rivers) -> None:
    poses = _played(clips_of_rivers, BLEND)
    ground = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) / PERIOD
    # It has walked before, and is not pulled back.
    assert np.linalg.norm(poses[-1, :2] - poses[0, :2]) > 0.5
    assert ground.max() < 2.0


def test_feet_in_contact_step_instead_of_sliding(clips_of_rivers) -> None:
    points = sole_points(_played(clips_of_rivers, BLEND))
    height = points[..., 2] - CONTACT_RADIUS
    step = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2)
    for moment, _ in CHANGES:
        first, last = round((moment + DWELL_TIME) / PERIOD), round((moment + DWELL_TIME + BLEND) / PERIOD)
        assert height[first:last].min() > -0.003
        for side in ("left", "right"):
            of_side = [k for k, name in enumerate(FOOT_CONTACTS) if name.startswith(side)]
            lowest = height[first:last, of_side].argmin(axis=1)
            rows = np.arange(last - first)
            low = height[first:last, of_side][rows, lowest] < 0.003
            assert step[first:last, of_side][rows, lowest][low].sum() < 0.02


def test_last_clip_plays_while_no_river_has_the_hand(clips_of_rivers) -> None:
    np.testing.assert_array_equal(_played(clips_of_rivers, BLEND, True), _played(clips_of_rivers, BLEND))


def _played_thrown_out(clips: RiverClips, let_go: bool) -> np.ndarray:
    """Poses of a hand that is thrown out of its river at 1.4 s, swings about, and is back in a river at 4.5 s."""
    t = np.arange(700) * PERIOD
    away = np.clip((t - 1.4) / 0.3, 0.0, 1.0) * np.clip((4.2 - t) / 0.3, 0.0, 1.0)
    away = away**3 * (10.0 - 15.0 * away + 6.0 * away**2)
    place = 0.15 * np.stack([np.sin(9.0 * t), np.cos(7.0 * t), np.ones(len(t))], axis=1)
    points = CURVES[0].point(t % LAP) + away[:, None] * place
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_PHASE] = t % LAP
    traces[(t >= 1.45) & (t < 4.5), TRACE_RIVER] = -1.0 if let_go else 0.0
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, BLEND, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus_path(points), traces, poses)
    return poses


def test_figure_stands_while_the_hand_is_outside_all_rivers(clips_of_rivers) -> None:
    poses = _played_thrown_out(clips_of_rivers, True)
    joint, root = _rates(poses)
    velocity = pose_difference(poses[:-1], poses[1:]) / PERIOD
    # It comes to rest, stands still while the hand swings, and continues, without a jump of pose or velocity.
    assert np.abs(np.diff(velocity, axis=0)).max() < 10.0
    still = slice(round(2.1 / PERIOD), round(4.2 / PERIOD))
    assert joint[still].max() < 1e-9
    assert root[still].max() < 1e-9
    assert joint[round(4.8 / PERIOD) :].max() > 0.5
    assert joint[: round(1.4 / PERIOD)].max() > 0.5
    # Control: if the river keeps such a hand, the figure is thrown about.
    assert _rates(_played_thrown_out(clips_of_rivers, False))[0][still].max() > 20.0


def _played_alternating(clips: RiverClips, seconds: float, blend: float) -> np.ndarray:
    """Poses while three rivers have the hand in turn, for `seconds` each, from 0.5 s on."""
    t = np.arange(300) * PERIOD
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_PHASE] = t % LAP
    traces[:, TRACE_RIVER] = np.where(t > 0.5, np.floor(t / seconds) % 3, 0.0)
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, blend, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus_path(CURVES[0].point(t)), traces, poses)
    return poses


def _largest_velocity_step(poses: np.ndarray) -> float:
    velocity = pose_difference(poses[:-1], poses[1:]) / PERIOD
    return float(np.abs(np.diff(velocity, axis=0)).max())


def test_alternating_rivers_change_the_clip_once_per_blend_time(clips_of_rivers) -> None:
    # The first change comes in the middle of a kick.
    assert _largest_velocity_step(_played_alternating(clips_of_rivers, 0.06, BLEND)) < 20.0
    assert _largest_velocity_step(_played_alternating(clips_of_rivers, 0.06, 0.0)) > 60.0


def test_momentary_river_changes_no_clip(clips_of_rivers) -> None:
    alone = _played_alternating(clips_of_rivers, 1e3, BLEND)
    np.testing.assert_array_equal(_played_alternating(clips_of_rivers, 0.03, BLEND), alone)
    assert np.abs(_played_alternating(clips_of_rivers, 0.06, BLEND) - alone).max() > 0.1


@pytest.mark.parametrize("clips", [("squat_dance", "walk", "angry"), ("walk", "run", "squat_dance")])
def test_feet_in_contact_do_not_slide_into_a_walk_or_run(clips: tuple[str, ...]) -> None:
    rivers = rivers_that_play(clips)
    for change in drawn_changes(rivers, 18, np.random.default_rng(3 if clips[0] == "squat_dance" else 2), False):
        # The hardest case, once 22 cm, is a kick into a walk that changes feet within the change.
        assert change.slide < 0.03
        assert change.depth < 0.003


@pytest.mark.parametrize(("first", "second"), [("jump", "angry"), ("angry", "jump")])
def test_change_waits_for_landing_or_takeoff(first: str, second: str) -> None:
    names = (first, second, "run")
    rivers = rivers_that_play(names)
    changed = 0
    for moment in np.arange(1.2, 4.2, 0.3):
        poses = played_change(rivers, 0, 1, moment)
        change = measured_change(poses)
        # Changes that begin in the air or end in a flight threw the root by up to 5.9 m/s within a step.
        assert change.vertical_jump < 0.3
        assert change.height < 0.28  # the jump's own 0.27
        assert change.slide < 0.03
        changed += np.abs(pose_difference(poses[-1:], played_change(rivers, 0, 0, moment)[-1:])).max() > 0.3
    assert changed >= 4


@pytest.mark.parametrize("stops", [False, True])
def test_stance_foot_neither_slides_nor_penetrates_during_changes_and_stops(stops: bool) -> None:
    clips = rivers_that_play(("squat_dance", "cheer", "angry"))
    for change in drawn_changes(clips, 12, np.random.default_rng(3), stops):
        # 6 cm of sliding and 50 cm below the floor without a stance foot and rest phases.
        assert change.height < 0.015
        assert change.depth < 0.003
        assert change.slide < 0.03


def test_stopped_figure_is_in_balance_only_with_rest_phases(clips_of_rivers) -> None:
    data, feet = mujoco.MjData(FIGURE), [FIGURE.geom(name).id for name in FOOT_CONTACTS]
    for clips, balanced in ((with_rests(clips_of_rivers, FIGURE), True), (clips_of_rivers, False)):
        missing = []
        for moment in (1.3, 1.45, 1.6, 1.75):
            pose = played_change(clips, 0, None, moment)[-1:]
            data.qpos[:] = pose[0]
            mujoco.mj_kinematics(FIGURE, data)
            mujoco.mj_comPos(FIGURE, data)
            centre, soles = data.subtree_com[1, :2], data.geom_xpos[feet] - [0.0, 0.0, CONTACT_RADIUS]
            missing.append(
                np.linalg.norm(nearest_supported(centre, soles[:, :2], soles[:, 2] < SWING_HEIGHT, 0.9) - centre)
            )
        assert (max(missing) < 1e-3) == balanced


@pytest.mark.parametrize(
    ("clips", "first", "second", "moment"),
    [
        # Here the root once followed a leg left behind and stopped when it was released: up to 5.4 m/s at once.
        (("run", "jump", "walk"), 0, 2, 2.0259264472833878),
        (("run", "jump", "walk"), 2, 0, 3.109084265589373),
        (("spin", "walk", "run"), 1, 2, 1.2860670251158335),
        (("spin", "walk", "run"), 2, 0, 3.065651),
        (("walk", "run", "squat_dance"), 0, 1, 2.1521299148440125),
        # Here knees once snapped straight, by 68 rad/s within an update, and a folded leg flung its hip round.
        (("walk", "run", "squat_dance"), 1, 2, 2.734170),
        (("walk", "run", "squat_dance"), 1, 2, 4.134903),
    ],
)
def test_velocity_is_continuous_in_difficult_changes(
    clips: tuple[str, ...], first: int, second: int, moment: float
) -> None:
    rivers = rivers_that_play(clips)
    change = measured_change(played_change(rivers, first, second, moment))
    finer = measured_change(played_change(rivers, first, second, moment, PERIOD / 8.0), PERIOD / 8.0)
    # A discontinuity would not shrink with the time step.
    assert np.all(np.array(finer[3:]) < 0.5 * np.array(change[3:]))
    assert change.horizontal_jump < 0.4
    assert change.vertical_jump < 0.2
    assert change.joint_jump < 30.0
    assert change.slide < 0.03


@pytest.mark.parametrize(("first", "moment"), [(0, 3.984633), (0, 2.025926), (1, 4.134903), (1, 4.142741)])
def test_figure_stops_smoothly_when_the_hand_is_thrown_off_the_river(first: int, moment: float) -> None:
    rivers = rivers_that_play(("run", "jump", "walk"))
    stop = measured_change(played_change(rivers, first, None, moment))
    # If the hand is followed up to twice the clip's pace, the root leaps by up to 3.7 m/s and joints by 114 rad/s.
    assert stop.horizontal_jump < 1.0
    assert stop.vertical_jump < 0.5
    assert stop.joint_jump < 32.0


def test_transitions_match_golden_poses(clips_of_rivers) -> None:
    poses = _played(clips_of_rivers, BLEND)[::15]
    np.testing.assert_allclose(poses, np.loadtxt(GOLDEN, delimiter=","), atol=1e-7)


if __name__ == "__main__":
    clips = [(clip.poses, clip.fps) for clip in load_clips(("squat_dance", "walk", "angry"))[0]]
    np.savetxt(
        GOLDEN, _played(RiverClips(CURVES, clips, 0.015, figure_legs(FIGURE)), BLEND)[::15], fmt="%.10g", delimiter=","
    )
