import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import N_POSE, figure_model, rest_pose
from models.mocap.motion.clip import Clip
from sim.body.clip_motion import clip_motion


def _wandering_clip(closing: bool) -> Clip:
    """A smooth motion of every joint that walks and turns left; closed after a second, or cut short before."""
    model, phase = figure_model(), 2 * np.pi * np.arange(61) / 60
    poses = np.empty((61, N_POSE))
    for k, p in enumerate(phase):
        poses[k] = rest_pose()
        swing = 0.3 * np.sin(p + np.arange(57))
        mujoco.mj_integratePos(model, poses[k], swing, 1.0)
        yaw, turn = 0.5 * p / (2 * np.pi), np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), yaw)
        moved = np.empty(3)
        mujoco.mju_rotVecQuat(moved, poses[k, :3], turn)
        poses[k, :3] = moved + np.array([0.2 * p, 0.1 * np.sin(yaw), 0])
        product = np.empty(4)
        mujoco.mju_mulQuat(product, turn, poses[k, 3:7])
        poses[k, 3:7] = product
    return Clip(poses if closing else poses[:40], 60.0, "wandering")


@pytest.mark.parametrize("closing", [True, False])
def test_velocities_and_accelerations_are_derivatives_of_the_poses(closing):
    model, clip, h = figure_model(), _wandering_clip(closing), 1e-4
    frames = np.arange(3, 170 if closing else 36, 4)
    times = (frames + 0.4) / 60  # off the knots, where the third derivative jumps
    here, before, after = (clip_motion(clip, times + shift) for shift in (0.0, -h, h))
    difference = np.empty(57)
    for k in range(len(times)):
        mujoco.mj_differentiatePos(model, difference, 2 * h, before.poses[k], after.poses[k])
        np.testing.assert_allclose(here.velocities[k], difference, atol=1e-5)
        central = (after.velocities[k] - before.velocities[k]) / (2 * h)
        np.testing.assert_allclose(here.accelerations[k], central, atol=2e-3)


def test_motion_passes_through_the_clip_frames():
    clip = _wandering_clip(closing=True)
    motion = clip_motion(clip, np.arange(60) / 60)
    np.testing.assert_allclose(motion.poses, clip.poses[:60], atol=1e-9)


def test_closed_clip_continues_over_laps():
    clip = _wandering_clip(closing=True)
    times = np.array([0.3, 1.3, 2.3])
    motion = clip_motion(clip, times)
    there = clip.displacement
    for k in (1, 2):
        np.testing.assert_allclose(there.moved(motion.poses[k - 1])[:3], motion.poses[k, :3], atol=1e-9)
        np.testing.assert_allclose(np.abs(np.sum(there.moved(motion.poses[k - 1])[3:7] * motion.poses[k, 3:7])), 1.0)
    np.testing.assert_allclose(motion.velocities[0, 3:], motion.velocities[2, 3:], atol=1e-8)


def test_open_clip_holds_its_last_pose():
    clip = _wandering_clip(closing=False)
    motion = clip_motion(clip, np.array([0.0, 5.0]))
    np.testing.assert_allclose(np.abs(motion.poses[1]), np.abs(clip.poses[-1]), atol=1e-9)
    assert np.abs(motion.velocities[1]).max() < 1e-9


def test_single_frame_is_a_motion_at_rest():
    motion = clip_motion(Clip(rest_pose()[None], 60.0, "still"), np.array([0.0, 1.0]))
    np.testing.assert_allclose(motion.poses, np.tile(rest_pose(), (2, 1)), atol=1e-12)
    assert np.abs(motion.accelerations).max() < 1e-9
