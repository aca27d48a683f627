"""Centre of mass, momentum, contacts and moved legs of clips, each against an independent computation."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.humanoid.skeleton import DEFAULT_MASS, FOOT_CONTACTS, figure_model, rest_pose
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.dynamics.moved_legs import displaced_with_planted_feet, hip_to_ankle
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip


def mujoco_points_and_rotations(poses, geoms=FOOT_CONTACTS, bodies=("left_foot", "right_foot")):
    """Positions of geoms and orientations of bodies, by MuJoCo."""
    model = figure_model()
    data = mujoco.MjData(model)
    points, turns = [], []
    for pose in poses:
        data.qpos = pose
        mujoco.mj_kinematics(model, data)
        points.append(data.geom_xpos[[model.geom(name).id for name in geoms]].copy())
        turns.append(data.xmat[[model.body(name).id for name in bodies]].copy())
    return np.array(points), np.array(turns)


def test_inertia_and_centre_of_mass_match_the_mujoco_mass_matrix():
    pose = embedded("backflip").poses[150]
    result = momentum(Clip(pose[None], 60.0, "still"))
    model = figure_model()
    data = mujoco.MjData(model)
    data.qpos = pose
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    R = Rotation.from_quat(pose[3:7], scalar_first=True).as_matrix()
    about_root = R @ M[3:6, 3:6] @ R.T
    arm = result.com[0] - pose[:3]
    steiner = DEFAULT_MASS * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert result.inertia[0] == pytest.approx(about_root - steiner, abs=1e-9)
    assert result.angular[0] == pytest.approx(np.zeros(3), abs=1e-12)


def test_angular_momentum_of_a_rigid_rotation_is_inertia_times_angular_velocity():
    pose, fps, spin = embedded("jump").poses[120], 240.0, np.array([0.7, -3.0, 0.4])
    com = momentum(Clip(pose[None], fps, "still")).com[0]
    poses = np.tile(pose, (9, 1))
    for k in range(9):
        turn = Rotation.from_rotvec(spin * (k - 4) / fps)
        poses[k, :3] = com + turn.apply(pose[:3] - com)
        poses[k, 3:7] = (turn * Rotation.from_quat(pose[3:7], scalar_first=True)).as_quat(scalar_first=True)
    result = momentum(Clip(poses, fps, "turning"))
    assert result.com == pytest.approx(np.tile(com, (9, 1)), abs=1e-12)
    assert result.angular[4] == pytest.approx(result.inertia[4] @ spin, rel=1e-3)


def standing_contacts(height, speed=0.0, frames=13, fps=120.0):
    poses = np.tile(rest_pose(), (frames, 1))
    poses[:, 2] += height
    poses[:, 0] += speed * np.arange(frames) / fps
    return contacts(Clip(poses, fps, "standing"))


@pytest.mark.parametrize(
    ("height", "speed", "expected"),
    [(0.0, 0.0, True), (0.04, 0.0, True), (-0.04, 0.0, True), (0.04, 0.3, True), (0.04, 2.0, False), (0.1, 0.0, False)],
)
def test_soles_are_loaded_only_when_slow_and_near_the_floor(height, speed, expected):
    result = standing_contacts(height, speed)
    assert np.all(result.supported == expected)
    assert np.all(result.loaded == expected)
    assert result.clearance == pytest.approx(np.full(13, height), abs=1e-3)


def test_body_lying_on_its_back_is_supported_with_unloaded_feet():
    pose = rest_pose()
    pose[3:7] = Rotation.from_rotvec([0.0, -np.pi / 2, 0.0]).as_quat(scalar_first=True)
    pose[2] = 0.14  # on the back
    result = contacts(Clip(np.tile(pose, (5, 1)), 60.0, "lying"))
    assert np.all(result.supported)
    assert not np.any(result.loaded)


@pytest.mark.parametrize("name", ["jump", "walk", "squat_dance"])
def test_planted_foot_keeps_its_pose_when_the_body_is_moved(name):
    poses = embedded(name).poses[::7]
    shift = 0.02 * np.column_stack([np.sin(np.arange(len(poses))), np.cos(np.arange(len(poses))), -np.ones(len(poses))])
    planted = np.tile([1.0, 0.0], (len(poses), 1))
    (before, turned), (after, turned_after) = (
        mujoco_points_and_rotations(poses),
        mujoco_points_and_rotations(displaced_with_planted_feet(poses, shift, planted)),
    )
    assert after[:, :4] == pytest.approx(before[:, :4], abs=1e-9)
    assert after[:, 4:] == pytest.approx(before[:, 4:] + shift[:, None], abs=1e-9)
    assert turned_after == pytest.approx(turned, abs=1e-9)


def test_zero_displacement_of_the_body_keeps_the_pose():
    poses = embedded("backflip").poses[::9]
    same = displaced_with_planted_feet(poses, np.zeros((len(poses), 3)), np.ones((len(poses), 2)))
    assert same == pytest.approx(poses, abs=1e-12)


def test_leg_straightens_towards_an_unreachable_planted_foot():
    poses = np.tile(rest_pose(), (2, 1))
    moved = displaced_with_planted_feet(poses, np.array([[0.0, 0.0, 0.3]] * 2), np.ones((2, 2)))
    lines, length = hip_to_ankle(moved)
    assert np.linalg.norm(lines, axis=2) == pytest.approx(np.full((2, 2), length), rel=1e-3)
    assert lines[:, :, 2] == pytest.approx(np.full((2, 2), -length), rel=1e-2)
