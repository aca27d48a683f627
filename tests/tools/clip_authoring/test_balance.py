"""Balance: the zero-moment point against inverse dynamics, and the sway that moves it into the support."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import Clip
from tests.tools.clip_authoring.support import distance_outside_support
from tools.clip_authoring.balance import balanced_clip, dynamics
from tools.clip_authoring.key_poses import Arm, Choreography, Key, Lap, Step, poses_at


def lunge():
    """A lunge of trunk and arm too fast to stay balanced on two feet."""
    start = Key(0.0, x=0.0, y=0.0, height=0.88, yaw=0, lean=0, tilt=0, trunk=(0, 0, 0), head=(0, 0, 0), left_arm=Arm(),
                right_arm=Arm())  # fmt: skip
    thrown = Key(0.5, x=0.1, y=0.05, lean=20, trunk=(35, 0, 15), right_arm=Arm(raised=95, plane=10))
    return Choreography("lunge", 1.6, [start, thrown], [Step(0.0, 0.0, 0.12)], [Step(0.0, 0.0, -0.12)], Lap())


def test_floor_force_and_zero_moment_point_match_inverse_dynamics():
    """MuJoCo computes the root forces independently, from accelerations of the coordinates."""
    fps = 960.0
    t = np.arange(0.0, 1.6 + 0.5 / fps, 1 / fps)
    clip = Clip(poses_at(lunge(), t), fps, "lunge")
    motion, velocities = dynamics(clip), clip.velocities()
    model = figure_model()
    model.dof_armature[:] = 0.0
    data = mujoco.MjData(model)
    for k in range(40, len(motion.com), 300):
        data.qpos, data.qvel = clip.poses[k], velocities[k]
        data.qacc = (velocities[k + 1] - velocities[k - 1]) * fps / 2
        mujoco.mj_inverse(model, data)
        force, moment = data.qfrc_inverse[:3], data.xmat[1].reshape(3, 3) @ data.qfrc_inverse[3:6]
        moment = moment + np.cross(clip.poses[k, :3], force)
        zmp = np.array([-moment[1], moment[0]]) / force[2]
        np.testing.assert_allclose(motion.force[k], force, atol=0.5)
        np.testing.assert_allclose(motion.zmp[k], zmp, atol=1e-3)


def test_standing_figure_exerts_its_weight_below_its_centre_of_mass():
    still = replace(lunge(), keys=lunge().keys[:1])
    motion = dynamics(Clip(poses_at(still, np.arange(97) / 60), 60.0, "still"))
    np.testing.assert_allclose(motion.force, np.tile([0.0, 0.0, 75.0 * 9.81], (96, 1)), atol=1e-6)
    np.testing.assert_allclose(motion.zmp, motion.com[:, :2], atol=1e-9)


def test_balancing_moves_the_zmp_into_the_support_without_moving_the_feet():
    motion = lunge()
    unbalanced = Clip(poses_at(motion, np.arange(97) / 60), 60.0, "lunge")
    assert distance_outside_support(dynamics(unbalanced)).max() > 0.1
    clip = balanced_clip(motion, 60.0)
    assert distance_outside_support(dynamics(clip)).max() < 1e-3
    assert clip.closes(1e-9)
    np.testing.assert_allclose(dynamics(clip).contacts, dynamics(unbalanced).contacts, atol=1e-3)
    assert np.abs(clip.poses[:, 2:7] - unbalanced.poses[:, 2:7]).max() == pytest.approx(0.0, abs=1e-12)
