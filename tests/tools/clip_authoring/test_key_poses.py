"""The authoring engine: anatomical angles, leg inverse kinematics, planted feet, C² motion and closed laps."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, figure_model, rest_pose
from models.mocap.motion.clip import Clip
from tools.clip_authoring.key_poses import Arm, Choreography, Key, Lap, Step, poses_at, solve_leg

HANGING = Arm(raised=0, plane=0, elbow=0)
MODEL = figure_model()
FORWARD, LEFT, UP = np.eye(3)


def standing(**changes):
    start = Key(0.0, x=0.0, y=0.0, height=0.88, yaw=0, lean=0, tilt=0, trunk=(0, 0, 0), head=(0, 0, 0),
                left_arm=HANGING, right_arm=HANGING)  # fmt: skip
    still = Choreography("still", 2.0, [start], [Step(0.0, 0.0, 0.1)], [Step(0.0, 0.0, -0.1)], Lap())
    return replace(still, **changes)


def standing_with_keys(**channels):
    """A standing choreography whose first key has some channels changed."""
    still = standing()
    return replace(still, keys=[replace(still.keys[0], **channels)])


def placed_figure(pose):
    data = mujoco.MjData(MODEL)
    data.qpos = pose
    mujoco.mj_kinematics(MODEL, data)
    return data


def direction_between(data, start, end):
    """Direction from one body's origin to another's."""
    line = data.body(end).xpos - data.body(start).xpos
    return line / np.linalg.norm(line)


def figure_with_arm(arm, side):
    return placed_figure(poses_at(standing_with_keys(**{f"{side}_arm": arm}), np.zeros(1))[0])


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("arm", "direction"),
    [
        (Arm(raised=0, plane=0, elbow=0), (0, 0, -1)),
        (Arm(raised=90, plane=0, elbow=0), (1, 0, 0)),
        (Arm(raised=90, plane=90, elbow=0), (0, 1, 0)),
        (Arm(raised=90, plane=-40, elbow=0), (np.cos(np.deg2rad(40)), -np.sin(np.deg2rad(40)), 0)),
        (Arm(raised=180, plane=0, elbow=0), (0, 0, 1)),
        (Arm(raised=45, plane=180, elbow=0), (-np.sqrt(0.5), 0, -np.sqrt(0.5))),
    ],
)
def test_upper_arm_points_along_the_given_elevation_and_plane(side, arm, direction):
    outwards = 1 if side == "left" else -1
    upper = direction_between(figure_with_arm(arm, side), f"{side}_upper_arm", f"{side}_forearm")
    np.testing.assert_allclose(upper, direction * np.array([1, outwards, 1]), atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_elbow_flexion_moves_the_hand_forwards_and_pronation_turns_the_palm_down(side):
    data = figure_with_arm(replace(HANGING, elbow=90), side)
    np.testing.assert_allclose(direction_between(data, f"{side}_forearm", f"{side}_hand"), FORWARD, atol=1e-9)
    inwards = -LEFT if side == "left" else LEFT
    palm = -UP  # palms face down in the T-pose
    np.testing.assert_allclose(data.body(f"{side}_hand").xmat.reshape(3, 3) @ palm, inwards, atol=1e-9)
    data = figure_with_arm(replace(HANGING, elbow=90, pronation=90), side)
    np.testing.assert_allclose(data.body(f"{side}_hand").xmat.reshape(3, 3) @ palm, -UP, atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_inward_arm_turn_crosses_the_forearm_and_wrist_flexion_bends_to_the_palm(side):
    inwards = -LEFT if side == "left" else LEFT
    data = figure_with_arm(replace(HANGING, elbow=90, turn=90), side)
    np.testing.assert_allclose(direction_between(data, f"{side}_forearm", f"{side}_hand"), inwards, atol=1e-9)
    hand = finger_direction(figure_with_arm(replace(HANGING, wrist=90), side), side)
    np.testing.assert_allclose(hand, inwards, atol=1e-9)


def finger_direction(data, side):
    """Direction of the fingers."""
    return data.body(f"{side}_hand").xmat.reshape(3, 3) @ (LEFT if side == "left" else -LEFT)


def test_trunk_pelvis_and_head_keys_rotate_about_their_named_axes():
    data = placed_figure(poses_at(standing_with_keys(trunk=(30, 0, 0)), np.zeros(1))[0])
    chest = data.body("chest").xmat.reshape(3, 3)
    np.testing.assert_allclose(chest @ UP, [0.5, 0, np.sqrt(0.75)], atol=1e-9)
    # The head is keyed against the pelvis: the gaze stays level when the trunk bends.
    np.testing.assert_allclose(data.body("head").xmat.reshape(3, 3), np.eye(3), atol=1e-9)
    chest = (
        placed_figure(poses_at(standing_with_keys(trunk=(0, 30, 0)), np.zeros(1))[0]).body("chest").xmat.reshape(3, 3)
    )
    np.testing.assert_allclose(chest @ UP, [0, 0.5, np.sqrt(0.75)], atol=1e-9)
    head = placed_figure(poses_at(standing_with_keys(head=(0, 0, 30)), np.zeros(1))[0]).body("head").xmat.reshape(3, 3)
    np.testing.assert_allclose(head @ FORWARD, [np.sqrt(0.75), 0.5, 0], atol=1e-9)
    pelvis = (
        placed_figure(poses_at(standing_with_keys(yaw=90, lean=10, tilt=0), np.zeros(1))[0])
        .body("pelvis")
        .xmat.reshape(3, 3)
    )
    np.testing.assert_allclose(pelvis @ UP, [0, np.sin(np.deg2rad(10)), np.cos(np.deg2rad(10))], atol=1e-9)


@settings(max_examples=60)
@given(
    side=st.sampled_from(["left", "right"]),
    reach=st.floats(0.3, 0.81),
    forwards=st.floats(-0.9, 0.9),
    outwards=st.floats(-0.5, 0.5),
    turns=st.tuples(*[st.floats(-0.6, 0.6)] * 6),
    knee=st.floats(-0.4, 0.6),
)
def test_leg_ik_reaches_the_foot_pose_with_pure_knee_flexion(side, reach, forwards, outwards, turns, knee):
    pelvis, foot = Rotation.from_euler("ZYX", [turns[:3]]), Rotation.from_euler("ZYX", [turns[3:]])
    root = np.array([[0.3, -0.2, 0.9]])
    sign = 1 if side == "left" else -1
    hip = root + pelvis.apply([0, sign * 0.0875, 0])
    line = np.array([forwards, outwards, -1.0])
    ankle = hip + reach * line / np.linalg.norm(line)
    leg = solve_leg(side, root, pelvis, ankle, foot, np.array([knee]))
    pose = rest_pose()
    pose[:3], pose[3:7] = root[0], pelvis.as_quat(scalar_first=True)[0]
    for joint, rotation in zip(("hip", "knee", "ankle"), leg, strict=True):
        k = 7 + 4 * JOINTS.index(f"{side}_{joint}")
        pose[k : k + 4] = rotation.as_quat(scalar_first=True)[0]
    body = placed_figure(pose).body(f"{side}_foot")
    np.testing.assert_allclose(body.xpos, ankle[0], atol=1e-9)
    np.testing.assert_allclose(body.xmat.reshape(3, 3), foot.as_matrix()[0], atol=1e-9)
    bend = leg[1].as_rotvec()[0]
    assert bend[1] > 0
    assert abs(bend[0]) + abs(bend[2]) < 1e-12


def test_leg_ik_beyond_reach_straightens_smoothly_without_overextension():
    changes = []
    for n in (1001, 2001):
        root, still = np.zeros((n, 3)), Rotation.identity(n)
        ankle = np.array([0.0, 0.0875, 0.0]) + np.outer(np.linspace(0.7, 1.2, n), [0.3, 0.0, -np.sqrt(1 - 0.09)])
        knee = solve_leg("left", root, still, ankle, still, np.zeros(n))[1].as_rotvec()[:, 1]
        assert np.all(np.diff(knee) < 0)
        assert knee[-1] > np.deg2rad(2)
        changes.append(np.abs(np.diff(knee, n=3)).max() * n**2)
    assert changes[1] < 0.65 * changes[0]  # second derivatives do not jump: their changes shrink with the step


def stepping():
    """The left foot rises on its toes, then steps forwards, and everything moves on by 0.4 m a lap."""
    still = standing(duration=1.2, lap=Lap(x=0.4))
    left = [Step(0.0, 0.0, 0.1), Step(0.3, 0.0, 0.1), Step(0.6, 0.0, 0.1, pitch=30), Step(1.0, 0.4, 0.1)]
    right = [Step(0.0, 0.0, -0.1), Step(0.3, 0.4, -0.1)]
    keys = [*still.keys, Key(0.5, height=0.84, trunk=(10, 5, 5), right_arm=Arm(raised=60, plane=20))]
    return replace(still, keys=keys, left_foot=left, right_foot=right)


def test_planted_toes_do_not_move_while_the_heel_rises_about_them():
    t = np.linspace(0.0, 0.6, 61)
    toes, heels = [], []
    for pose in poses_at(stepping(), t):
        data = placed_figure(pose)
        toes.append([data.geom(name).xpos.copy() for name in ("left_toe_in", "left_toe_out")])
        heels.append(data.geom("left_heel_in").xpos[2])
    assert np.ptp(np.array(toes), axis=0).max() < 1e-9
    np.testing.assert_allclose(np.array(toes)[..., 2], CONTACT_RADIUS, atol=1e-9)
    np.testing.assert_allclose(heels[:31], CONTACT_RADIUS, atol=1e-9)
    assert heels[-1] > 0.1


def test_default_swing_clears_the_floor_without_penetrating_it():
    heights = [
        placed_figure(pose).geom("right_toe_in").xpos[2] for pose in poses_at(stepping(), np.linspace(0.0, 0.3, 31))
    ]
    assert max(heights) > CONTACT_RADIUS + 0.05
    assert min(heights) >= CONTACT_RADIUS - 1e-9


def test_lap_closes_with_its_displacement():
    clip = Clip(poses_at(stepping(), np.arange(73) / 60), 60.0, "stepping")
    assert clip.closes(1e-9)
    np.testing.assert_allclose([clip.displacement.x, clip.displacement.y], [0.4, 0.0], atol=1e-12)


@pytest.mark.parametrize("motion", [stepping(), replace(stepping(), lap=None)], ids=["cyclic", "open"])
def test_accelerations_are_continuous(motion):
    """Halving the step halves the largest change of acceleration from frame to frame; across a jump it would not."""
    changes = []
    for step in (2e-3, 1e-3):
        t = np.arange(0.0, motion.duration * 1.5, step)
        v = Clip(poses_at(motion, t), 1 / step, "fine").velocities()[1:-1]
        changes.append(np.abs(np.diff(v, n=2, axis=0)).max() / step)
    assert changes[1] < 0.65 * changes[0]


def test_open_motion_starts_and_ends_at_rest():
    motion = replace(standing(lap=None), keys=[*standing().keys, Key(1.0, height=0.8, trunk=(20, 0, 0))])
    poses = poses_at(motion, np.array([-1.0, 0.0, 0.01, 0.99, 1.0, 5.0]))
    np.testing.assert_array_equal(poses[0], poses[1])
    np.testing.assert_array_equal(poses[4], poses[5])
    np.testing.assert_allclose(poses[2], poses[1], atol=1e-5)
    np.testing.assert_allclose(poses[3], poses[4], atol=1e-5)
    assert poses[4, 2] == pytest.approx(0.8)


def test_sway_moves_the_pelvis_but_not_the_feet():
    poses = poses_at(standing(), np.zeros(1)), poses_at(standing(), np.zeros(1), np.array([[0.03, -0.05]]))
    np.testing.assert_allclose(poses[1][0, :2] - poses[0][0, :2], [0.03, -0.05])
    before, after = (placed_figure(p[0]).body("left_foot").xpos.copy() for p in poses)
    np.testing.assert_allclose(before, after, atol=1e-9)


def test_airborne_step_places_the_ankle_at_its_target():
    step = Step.in_air(1.0, (0.5, 0.1, 0.6), yaw=20, pitch=-50)
    motion = standing(left_foot=[Step(0.0, 0.0, 0.1), step])
    np.testing.assert_allclose(
        placed_figure(poses_at(motion, np.ones(1))[0]).body("left_foot").xpos, [0.5, 0.1, 0.6], atol=1e-9
    )


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (standing(keys=[Key(0.0, x=0.0)]), "no key sets y"),
        (standing(keys=[*standing().keys, Key(2.5, x=0.1)]), r"keys of x at \[0.0, 2.5\]"),
        (standing(keys=[*standing().keys, Key(-0.5, x=0.1)]), "must increase"),
        (standing(left_foot=[Step(0.0, 0.0, 0.1), Step(2.0, 0.0, 0.1)]), "steps of the left foot"),
        (standing(right_foot=[Step(0.0, 0.0, -0.1, rest=False)]), "no step of the right foot rests"),
    ],
)
def test_invalid_choreography_is_refused_with_the_reason(broken, message):
    with pytest.raises(ModelError, match=message):
        poses_at(broken, np.zeros(1))
