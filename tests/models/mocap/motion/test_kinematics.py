"""Forward kinematics by quaternions is MuJoCo's."""

import mujoco
import numpy as np
import pytest

from models.humanoid.skeleton import BODIES, N_TANGENT, figure_model, rest_pose
from models.mocap.motion.kinematics import global_rotations, segment_positions


@pytest.mark.parametrize("stature", [1.75, 1.5])
def test_segment_positions_match_mujoco_kinematics(stature: float) -> None:
    figure, rng = figure_model(stature), np.random.default_rng(1)
    poses, data = np.tile(rest_pose(stature), (5, 1)), mujoco.MjData(figure)
    for pose in poses:
        mujoco.mj_integratePos(figure, pose, rng.normal(scale=0.3, size=N_TANGENT), 1.0)
    positions = segment_positions(poses[:, :3], global_rotations(poses), figure)
    for pose, origins in zip(poses, positions, strict=True):
        data.qpos = pose
        mujoco.mj_kinematics(figure, data)
        np.testing.assert_allclose(origins, [data.body(body).xpos for body in BODIES], atol=1e-12)
