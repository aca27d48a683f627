"""From one river's clip to another's: no jump of pose or velocity, feet that step, and the same again."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from experiments.balance import nearest_supported
from experiments.clips import load_clips
from experiments.figure_maps import figure_legs, packed_legs
from experiments.hands import stylus_path
from experiments.modes import river_bundle
from experiments.rests import with_rests
from models.humanoid.skeleton import FOOT_CONTACTS, figure_model
from models.mocap.clip import pose_difference
from sim.reference import make_reference, reference_along
from sim.transition import DWELL

GOLDEN = Path(__file__).parent.parent / "golden" / "river_clips.csv"
PERIOD, LAP, BLEND = 8e-3, 3.4, 0.4
FIGURE = figure_model()
CURVES = [river.curve for river in river_bundle(Trajectory.circle(0.0477, LAP), 0.025, 0.02, 4.0, 0.015).rivers]
CHANGES = ((1.4, 1), (2.9, 2), (4.3, 0), (5.8, 2))


@pytest.fixture(scope="module")
def clips_of_rivers() -> RiverClips:
    clips = [(clip.poses, clip.fps) for clip in load_clips(("squat_dance", "walk", "angry"))[0]]
    return RiverClips(CURVES, clips, 0.015, figure_legs(FIGURE))


def _played(clips: RiverClips, blend: float, none_between: bool = False) -> np.ndarray:
    """Poses of a hand that glides from river to river, every 8 ms for 7.2 s."""
    t = np.arange(900) * PERIOD
    river, share = np.zeros(len(t)), np.zeros((3, len(t)))
    share[0] = 1.0
    for moment, number in CHANGES:
        river[t >= moment] = number
        s = np.clip((t - moment) / 0.3 + 0.5, 0.0, 1.0)
        s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        share *= 1.0 - s
        share[number] += s
        if none_between:
            river[(t >= moment - 0.1) & (t < moment)] = -1.0
    points = sum(w[:, None] * curve.point(t % LAP) for w, curve in zip(share, CURVES, strict=True))
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_RIVER], traces[:, TRACE_PHASE] = river, t % LAP
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, blend, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus_path(points), traces, poses)
    return poses


def _at_changes(values: np.ndarray) -> np.ndarray:
    """Largest of rows from three before to three behind each change."""
    rows = [round((moment + DWELL) / PERIOD) for moment, _ in CHANGES]
    return np.array([values[k - 3 : k + 3].max() for k in rows])


def _rates(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest rate of a joint [rad/s] and of the root [m/s], each step."""
    rate = np.abs(pose_difference(poses[:-1], poses[1:])) / PERIOD
    return rate[:, 6:].max(axis=1), rate[:, :3].max(axis=1)


def test_pose_and_velocity_are_continuous_at_a_change_and_without_inertialisation_they_are_not(clips_of_rivers) -> None:
    joint, root = _rates(_played(clips_of_rivers, BLEND))
    jumping_joint, jumping_root = _rates(_played(clips_of_rivers, 0.0))
    # Within what the clips themselves do elsewhere.
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


def test_the_figure_goes_on_where_it_stands(clips_of_rivers) -> None:
    poses = _played(clips_of_rivers, BLEND)
    ground = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) / PERIOD
    # It walked more than a metre before, and is not pulled back.
    assert np.linalg.norm(poses[-1, :2] - poses[0, :2]) > 0.5
    assert ground.max() < 2.0


def test_feet_that_touch_the_floor_step_instead_of_sliding(clips_of_rivers) -> None:
    poses, data = _played(clips_of_rivers, BLEND), mujoco.MjData(FIGURE)
    ids = [FIGURE.geom(name).id for name in FOOT_CONTACTS]
    points = np.empty((len(poses), len(ids), 3))
    for pose, row in zip(poses, points, strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(FIGURE, data)
        row[:] = data.geom_xpos[ids]
    height = points[..., 2] - FIGURE.geom_size[ids, 0]
    step = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2)
    for moment, _ in CHANGES:
        first, last = round((moment + DWELL) / PERIOD), round((moment + DWELL + BLEND) / PERIOD)
        assert height[first:last].min() > -0.003
        for side in ("left", "right"):
            of_side = [k for k, name in enumerate(FOOT_CONTACTS) if name.startswith(side)]
            lowest = height[first:last, of_side].argmin(axis=1)
            rows = np.arange(last - first)
            low = height[first:last, of_side][rows, lowest] < 0.003
            assert step[first:last, of_side][rows, lowest][low].sum() < 0.02


def test_while_no_river_has_the_hand_the_last_clip_plays(clips_of_rivers) -> None:
    np.testing.assert_array_equal(_played(clips_of_rivers, BLEND, True), _played(clips_of_rivers, BLEND))


def _thrown(clips: RiverClips, let_go: bool) -> np.ndarray:
    """Poses of a hand that is thrown far out of its river at 1.4 s, swings about, comes back, and is taken at 4.5 s."""
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


def test_a_hand_that_leaves_all_rivers_leaves_the_figure_standing(clips_of_rivers) -> None:
    poses = _thrown(clips_of_rivers, True)
    joint, root = _rates(poses)
    velocity = pose_difference(poses[:-1], poses[1:]) / PERIOD
    # It comes to rest, stands still however the hand swings, and goes on: without a jump of pose or velocity.
    assert np.abs(np.diff(velocity, axis=0)).max() < 10.0
    still = slice(round(2.1 / PERIOD), round(4.2 / PERIOD))
    assert joint[still].max() < 1e-9
    assert root[still].max() < 1e-9
    assert joint[round(4.8 / PERIOD) :].max() > 0.5
    assert joint[: round(1.4 / PERIOD)].max() > 0.5
    # A river that keeps such a hand has the figure thrown about: the control.
    assert _rates(_thrown(clips_of_rivers, False))[0][still].max() > 20.0


def _in_turns(clips: RiverClips, seconds: float, blend: float) -> np.ndarray:
    """Poses while rivers have the hand in turns, for so long each, from 0.5 s on."""
    t = np.arange(300) * PERIOD
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_PHASE] = t % LAP
    traces[:, TRACE_RIVER] = np.where(t > 0.5, np.floor(t / seconds) % 3, 0.0)
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, blend, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus_path(CURVES[0].point(t)), traces, poses)
    return poses


def _jerk(poses: np.ndarray) -> float:
    velocity = pose_difference(poses[:-1], poses[1:]) / PERIOD
    return float(np.abs(np.diff(velocity, axis=0)).max())


def test_rivers_that_have_the_hand_in_turns_change_the_clip_once_in_a_blend_time(clips_of_rivers) -> None:
    # The first change comes in the middle of a kick.
    assert _jerk(_in_turns(clips_of_rivers, 0.06, BLEND)) < 20.0
    assert _jerk(_in_turns(clips_of_rivers, 0.06, 0.0)) > 60.0


def test_a_river_that_has_the_hand_for_a_moment_changes_no_clip(clips_of_rivers) -> None:
    alone = _in_turns(clips_of_rivers, 1e3, BLEND)
    np.testing.assert_array_equal(_in_turns(clips_of_rivers, 0.03, BLEND), alone)
    assert np.abs(_in_turns(clips_of_rivers, 0.06, BLEND) - alone).max() > 0.1


def _soles(poses: np.ndarray) -> np.ndarray:
    """Lowest points of the feet's contact spheres, shape (n, 8, 3)."""
    data, ids = mujoco.MjData(FIGURE), [FIGURE.geom(name).id for name in FOOT_CONTACTS]
    points = np.empty((len(poses), len(ids), 3))
    for pose, row in zip(poses, points, strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(FIGURE, data)
        row[:] = data.geom_xpos[ids]
    points[..., 2] -= FIGURE.geom_size[ids, 0]
    return points


def _slide(soles: np.ndarray) -> float:
    """Largest distance of a point from where it came within 3 mm of the floor, while it is there."""
    worst = 0.0
    for point in np.moveaxis(soles, 1, 0):
        since = None
        for place in point:
            since = None if place[2] >= 0.003 else place[:2] if since is None else since
            worst = worst if since is None else max(worst, float(np.linalg.norm(place[:2] - since)))
    return worst


def _two(clips: RiverClips, first: int, second: int, moment: float, away: bool) -> np.ndarray:
    """Poses of a hand that goes from one river to another, or is thrown away, at a moment; until 0.8 s later."""
    t = np.arange(round((moment + 0.8) / PERIOD)) * PERIOD
    s = np.clip((t - moment) / 0.3 + (0.0 if away else 0.5), 0.0, 1.0)[:, None]
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    there = CURVES[first].point(t % LAP)
    points = there + s * ([0.1, 0.0, 0.1] if away else CURVES[second].point(t % LAP) - there)
    traces = np.zeros((len(t), TRACE_SIZE))
    traces[:, TRACE_PHASE] = t % LAP
    traces[:, TRACE_RIVER] = np.where(t < moment, first, -1.0 if away else second)
    # A run that begins on another river than the first goes over at once, long before the moment.
    reference = make_reference(FIGURE, clips.compiled(), PERIOD, 6.0, BLEND, packed_legs(FIGURE))
    poses = np.empty((len(t), 75))
    reference_along(reference, stylus_path(points), traces, poses)
    return poses[round(moment / PERIOD) :]


@pytest.mark.parametrize("clips", [("squat_dance", "walk", "angry"), ("walk", "run", "squat_dance")])
def test_no_foot_that_touches_slides_into_a_walk_or_a_run(clips: tuple[str, ...]) -> None:
    made = [(clip.poses, clip.fps) for clip in load_clips(clips)[0]]
    rivers = with_rests(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), FIGURE)
    draw = np.random.default_rng(3 if clips[0] == "squat_dance" else 2)
    for _ in range(18):
        first, second = draw.permutation(3)[:2]
        soles = _soles(_two(rivers, int(first), int(second), 1.2 + 3.0 * draw.random(), False))
        # Where a kick went over into a walk that changes feet within the change it was 22 cm.
        assert _slide(soles) < 0.03
        assert soles[..., 2].min() > -0.003


@pytest.mark.parametrize(("first", "second"), [("jump", "angry"), ("angry", "jump")])
def test_a_change_waits_for_a_leap_to_land_and_for_one_to_begin(first: str, second: str) -> None:
    names = (first, second, "run")
    made = [(clip.poses, clip.fps) for clip in load_clips(names)[0]]
    rivers = with_rests(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), FIGURE)
    changed = 0
    for moment in np.arange(1.2, 4.2, 0.3):
        poses = _two(rivers, 0, 1, float(moment), False)
        soles = _soles(poses)
        velocity = np.diff(poses[:, 2]) / PERIOD
        # Begun in the air, or over into a flight, the root was thrown by up to 5.9 m/s within a step.
        assert np.abs(np.diff(velocity)).max() < 0.5
        assert soles[..., 2].min(axis=1).max() < 0.28  # the jump's own 0.27
        assert _slide(soles) < 0.03
        changed += np.abs(pose_difference(poses[-1:], _two(rivers, 0, 0, float(moment), False)[-1:])).max() > 0.3
    assert changed >= 4


@pytest.mark.parametrize("away", [False, True])
def test_one_foot_stands_through_every_change_and_stop_and_none_slides_or_goes_through_the_floor(away: bool) -> None:
    made = [(clip.poses, clip.fps) for clip in load_clips(("squat_dance", "cheer", "angry"))[0]]
    clips = with_rests(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), FIGURE)
    draw = np.random.default_rng(3)
    for _ in range(12):
        first, second = draw.permutation(3)[:2]
        soles = _soles(_two(clips, int(first), int(second), 1.2 + 3.0 * draw.random(), away))
        # Without a foot that stands and phases of rest it was 6 cm, and 50 cm below the floor.
        assert soles[..., 2].min(axis=1).max() < 0.015
        assert soles[..., 2].min() > -0.003
        assert _slide(soles) < 0.03


def test_a_figure_that_stops_can_stand_there(clips_of_rivers) -> None:
    data = mujoco.MjData(FIGURE)
    for clips, balanced in ((with_rests(clips_of_rivers, FIGURE), True), (clips_of_rivers, False)):
        missing = []
        for moment in (1.3, 1.45, 1.6, 1.75):
            pose = _two(clips, 0, 0, moment, True)[-1:]
            data.qpos[:] = pose[0]
            mujoco.mj_kinematics(FIGURE, data)
            mujoco.mj_comPos(FIGURE, data)
            centre = data.subtree_com[1, :2]
            missing.append(np.linalg.norm(nearest_supported(centre, _soles(pose)[0], 0.9) - centre))
        assert (max(missing) < 1e-3) == balanced


def _leaps(poses: np.ndarray) -> tuple[float, float, float]:
    """Largest changes of velocity from one update to the next: root over the ground, and up [m/s], joints [rad/s]."""
    rates = pose_difference(poses[:-1], poses[1:]) / PERIOD
    leaps = np.abs(np.diff(rates, axis=0))
    return leaps[:, :2].max(), leaps[:, 2].max(), leaps[:, 6:].max()


@pytest.mark.parametrize(
    ("clips", "first", "second", "moment"),
    [
        # The root went down for a leg that was left behind, and no further once it was lost: by up to 5.4 m/s at once.
        (("run", "jump", "walk"), 0, 2, 2.0259264472833878),
        (("run", "jump", "walk"), 2, 0, 3.109084265589373),
        (("spin", "walk", "run"), 1, 2, 1.2860670251158335),
        (("spin", "walk", "run"), 2, 0, 3.065651),
        (("walk", "run", "squat_dance"), 0, 1, 2.1521299148440125),
        # Knees snapped straight, 68 rad/s within an update, and a leg that folded under its hip flung it round.
        (("walk", "run", "squat_dance"), 1, 2, 2.734170),
        (("walk", "run", "squat_dance"), 1, 2, 4.134903),
    ],
)
def test_no_velocity_leaps_in_a_change(clips: tuple[str, ...], first: int, second: int, moment: float) -> None:
    made = [(clip.poses, clip.fps) for clip in load_clips(clips)[0]]
    rivers = with_rests(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), FIGURE)
    poses = _two(rivers, first, second, moment, False)
    over, up, joint = _leaps(poses)
    assert over < 0.4
    assert up < 0.2
    assert joint < 30.0
    assert _slide(_soles(poses)) < 0.03


@pytest.mark.parametrize(("first", "moment"), [(0, 3.984633), (0, 2.025926), (1, 4.134903), (1, 4.142741)])
def test_a_hand_that_is_thrown_off_does_not_throw_the_figure(first: int, moment: float) -> None:
    made = [(clip.poses, clip.fps) for clip in load_clips(("run", "jump", "walk"))[0]]
    rivers = with_rests(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), FIGURE)
    over, up, joint = _leaps(_two(rivers, first, 2, moment, True))
    # Followed until it raced the clip twice over the root leapt by up to 3.7 m/s, and joints by 114 rad/s.
    assert over < 1.0
    assert up < 0.5
    assert joint < 20.0


def test_transitions_are_as_they_ever_were(clips_of_rivers) -> None:
    poses = _played(clips_of_rivers, BLEND)[::15]
    np.testing.assert_allclose(poses, np.loadtxt(GOLDEN, delimiter=","), atol=1e-7)


if __name__ == "__main__":
    made = [(clip.poses, clip.fps) for clip in load_clips(("squat_dance", "walk", "angry"))[0]]
    np.savetxt(
        GOLDEN, _played(RiverClips(CURVES, made, 0.015, figure_legs(FIGURE)), BLEND)[::15], fmt="%.10g", delimiter=","
    )
