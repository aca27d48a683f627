from itertools import pairwise

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.quaternions import heading
from models.errors import ModelError
from models.humanoid.skeleton import figure_model, rest_pose
from models.mocap.motion.clip import Clip, PlanarDisplacement, pose_difference


@pytest.fixture(scope="module")
def model():
    return figure_model()


def smooth_poses(model, n, seed, speed=0.02):
    """Poses that drift by small random tangents, integrated by MuJoCo."""
    rng = np.random.default_rng(seed)
    pose, poses = rest_pose(), []
    tangent = rng.normal(size=57)
    for _ in range(n):
        poses.append(pose.copy())
        tangent = tangent + 0.3 * rng.normal(size=57)
        mujoco.mj_integratePos(model, pose, tangent, speed)
    return np.array(poses)


def test_pose_difference_matches_mujoco(model):
    poses = smooth_poses(model, 40, seed=1, speed=0.4)
    expected = np.empty((39, 57))
    for row, (start, end) in zip(expected, pairwise(poses), strict=True):
        mujoco.mj_differentiatePos(model, row, 1.0, start, end)
    np.testing.assert_allclose(pose_difference(poses[:-1], poses[1:]), expected, atol=1e-12)


def test_velocities_are_central_differences_on_the_manifold(model):
    poses = smooth_poses(model, 12, seed=2)
    velocities = Clip(poses, 50.0, "drift").velocities()
    forward, backward = np.empty(57), np.empty(57)
    for k in range(1, 11):
        mujoco.mj_differentiatePos(model, forward, 1 / 50, poses[k], poses[k + 1])
        mujoco.mj_differentiatePos(model, backward, 1 / 50, poses[k - 1], poses[k])
        np.testing.assert_allclose(velocities[k], (forward + backward) / 2, atol=1e-9)
    mujoco.mj_differentiatePos(model, forward, 1 / 50, poses[0], poses[1])
    np.testing.assert_allclose(velocities[0], forward, atol=1e-9)


def test_velocities_of_a_turning_lap_continue_into_the_next_lap(model):
    lap = circling_lap(24)
    twice = np.vstack((lap.poses[:-1], lap.displacement.moved(lap.poses)))
    long = Clip(twice, lap.fps, "two laps").velocities()
    np.testing.assert_allclose(lap.velocities()[-1], long[lap.n_frames - 1], atol=1e-9)
    first, last = lap.velocities()[[0, -1]]
    # The same motion, with the heading turned by that of one lap.
    np.testing.assert_allclose(first[3:], last[3:], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(first[:3]), np.linalg.norm(last[:3]), atol=1e-9)


def circling_lap(n):
    """A walk along a quarter circle of radius 1 m; every joint returns to its first angle."""
    s = np.linspace(0.0, 1.0, n)
    poses = np.tile(rest_pose(), (n, 1))
    angle = s * np.pi / 2
    poses[:, 0], poses[:, 1] = np.sin(angle), 1.0 - np.cos(angle)
    poses[:, 3], poses[:, 6] = np.cos(angle / 2), np.sin(angle / 2)
    knee = 0.4 * np.sin(2 * np.pi * s)
    poses[:, 7 + 4 * 12], poses[:, 9 + 4 * 12] = np.cos(knee / 2), np.sin(knee / 2)
    return Clip(poses, 30.0, "quarter circle")


def test_lap_displacement_maps_the_first_frame_onto_the_last():
    lap = circling_lap(24)
    move = lap.displacement
    np.testing.assert_allclose((move.x, move.y, move.yaw), (1.0, 1.0, np.pi / 2), atol=1e-12)
    assert lap.closes(1e-9)


def test_clip_with_different_end_joint_or_height_does_not_close():
    lap = circling_lap(24)
    bent = lap.poses.copy()
    bent[-1, 7:11] = np.cos(0.005), np.sin(0.005), 0.0, 0.0
    assert not Clip(bent, 30.0, "bent").closes(1e-3)
    assert Clip(bent, 30.0, "bent").closes(0.011)
    raised = lap.poses.copy()
    raised[-1, 2] += 0.01
    assert not Clip(raised, 30.0, "raised").closes(1e-3)
    assert not Clip(lap.poses[:1], 30.0, "one frame").closes()


def test_full_turn_closes_although_its_quaternion_changes_sign():
    angle = np.linspace(0.0, 2 * np.pi, 33)
    poses = np.tile(rest_pose(), (33, 1))
    poses[:, 3], poses[:, 6] = np.cos(angle / 2), np.sin(angle / 2)
    spin = Clip(poses, 60.0, "spin")
    assert spin.poses[-1, 3] == pytest.approx(-1.0)
    assert spin.closes(1e-9)
    np.testing.assert_allclose(spin.velocities()[:, 5], 2 * np.pi * 60 / 32, rtol=1e-9)


def test_quaternions_are_normalised_and_made_continuous_in_sign():
    rng = np.random.default_rng(3)
    poses = np.tile(rest_pose(), (50, 1))
    poses[:, 3:] *= (rng.choice([-1.0, 1.0], size=(50, 18)) * rng.uniform(0.5, 2.0, size=(50, 18))).repeat(4, axis=1)
    quaternions = Clip(poses, 30.0, "flips").poses[:, 3:].reshape(50, 18, 4)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=2), 1.0, atol=1e-15)
    assert (np.sum(quaternions[1:] * quaternions[:-1], axis=2) > 0).all()


def test_duration_counts_intervals_and_displacement_moves_poses_in_the_plane():
    clip = Clip(np.tile(rest_pose(), (31, 1)), 30.0, "still")
    assert clip.duration == pytest.approx(1.0)
    moved = PlanarDisplacement(1.0, 2.0, np.pi / 2).moved(clip.poses)
    np.testing.assert_allclose(moved[:, :3], np.tile([1.0, 2.0, rest_pose()[2]], (31, 1)))
    np.testing.assert_allclose(moved[:, 3:7], np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (31, 1)))


def test_clip_does_not_share_memory_with_its_source():
    poses = np.tile(rest_pose(), (3, 1))
    clip = Clip(poses, 30.0, "copy")
    poses[:] = 0.0
    assert clip.poses[0, 2] == rest_pose()[2]


@pytest.mark.parametrize(
    ("poses", "fps", "message"),
    [
        (np.zeros((3, 74)), 30.0, r"shape \(3, 74\)"),
        (np.zeros((0, 75)), 30.0, r"shape \(0, 75\)"),
        (np.full((2, 75), np.nan), 30.0, "frame 0 is not finite"),
        (np.zeros((2, 75)), 30.0, "frame 0 has a zero quaternion"),
        (np.tile(rest_pose(), (2, 1)), 0.0, "frames per second"),
        (np.tile(rest_pose(), (2, 1)), np.inf, "frames per second"),
    ],
)
def test_invalid_poses_or_frame_rate_are_refused(poses, fps, message):
    with pytest.raises(ModelError, match=message):
        Clip(poses, fps, "bad")


def test_heading_is_the_direction_of_the_x_axis_on_the_floor():
    rotations = Rotation.random(50, rng=np.random.default_rng(5))
    x, y, _ = rotations.apply([1.0, 0.0, 0.0]).T
    np.testing.assert_allclose(heading(rotations.as_quat(scalar_first=True)), np.arctan2(y, x), atol=1e-12)
