"""The map to a robot arm: agreement with MuJoCo's forward kinematics, joint limits and the Jacobian."""

import mujoco
import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.robot_arm import RobotArm
from experiments.setups.maps.robot_arm import HOME, ORIENTATION, robot_arm_map
from geometry.rotations import exponential, multiply
from models.robot_arm.spec import TOOL, arm_lengths, arm_limits, arm_model
from tests.controllers.clips_for_maps import assert_same_compiled
from tests.derivatives import extrapolated_differences

MODEL, SCALE = arm_model(), 1.5
LIMITS = arm_limits(MODEL)
MAP = robot_arm_map(MODEL, SCALE)


def random_stylus(rng: np.random.Generator, distance: float, angle: float):
    direction, axis = rng.normal(size=(2, 3))
    turn = axis / np.linalg.norm(axis) * rng.uniform(0.0, angle)
    return np.concatenate([direction / np.linalg.norm(direction) * rng.uniform(0.0, distance), exponential(*turn)])


def tool_pose(q):
    data = mujoco.MjData(MODEL)
    data.qpos[:] = q
    mujoco.mj_kinematics(MODEL, data)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, data.site(TOOL).xmat)
    return data.site(TOOL).xpos.copy(), quaternion


def test_tool_follows_the_stylus_by_mujoco_kinematics():
    rng = np.random.default_rng(1)
    for _ in range(1000):
        x = random_stylus(rng, 0.07, np.radians(15.0))
        position, quaternion = tool_pose(MAP.pose(x))
        np.testing.assert_allclose(position, HOME + SCALE * x[:3], atol=1e-9)
        expected = np.array(multiply(*x[3:], *ORIENTATION))
        assert 1.0 - abs(quaternion @ expected) < 1e-12


def test_joints_stay_within_their_limits_for_any_stylus():
    rng = np.random.default_rng(2)
    limits = arm_limits(MODEL)
    poses = np.array([MAP.pose(random_stylus(rng, 0.4, 3.1)) for _ in range(3000)])
    assert np.all(poses > limits[:, 0] + np.radians(5.0))
    assert np.all(poses < limits[:, 1] - np.radians(5.0))


def test_arm_stays_at_the_edge_of_its_domain_for_a_distant_stylus():
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        x = np.concatenate([1e6 * direction, [1.0, 0.0, 0.0, 0.0]])
        position, _ = tool_pose(MAP.pose(x))
        np.testing.assert_allclose(position, HOME + SCALE * 0.1 * direction, atol=1e-6)


def test_jacobian_matches_finite_differences():
    rng = np.random.default_rng(3)
    for _ in range(1000):
        x = random_stylus(rng, 0.15, 2.0)

        def pose_at(tangent, x=x):
            turned = multiply(*exponential(*tangent[3:]), *x[3:])
            return MAP.pose(np.concatenate([x[:3] + tangent[:3], turned]))

        numeric = extrapolated_differences(pose_at, np.zeros(6), 1e-5)
        assert np.linalg.norm(MAP.jacobian(x) - numeric) <= 1e-6 * np.linalg.norm(numeric)


def test_pose_is_smooth_over_the_edge_of_the_domain():
    """Second differences along lines through the edge have no jump: h is C² there."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        x = random_stylus(rng, 0.02, 0.1)
        direction = rng.normal(size=3)
        s = np.linspace(0.0, 0.15, 3001)
        path = np.hstack([x[:3] + s[:, None] * direction / np.linalg.norm(direction), np.tile(x[3:], (len(s), 1))])
        second = np.diff(np.array([MAP.pose(point) for point in path]), 2, axis=0) / (s[1] - s[0]) ** 2
        assert np.abs(np.diff(second, axis=0)).max() < 0.05 * np.ptp(second, axis=0).max()


def test_compiled_map_is_identical():
    assert_same_compiled(MAP, random_stylus(np.random.default_rng(5), 0.2, 1.0))


def test_unreachable_domain_raises_with_its_position():
    with pytest.raises(ParameterError, match=r"cannot follow a stylus at .* mm turned by"):
        RobotArm(arm_lengths(MODEL), HOME, ORIENTATION, 6.0, (0.07, 0.1), (0.25, 0.45), 0.5).check_domain(
            LIMITS, lambda arm, points: np.array([arm.pose(x) for x in points])
        )


@pytest.mark.parametrize(("reach", "scale"), [((0.1, 0.1), 1.0), ((0.07, 0.1), -1.0), ((0.07, np.nan), 1.0)])
def test_out_of_range_arguments_raise_parameter_error(reach, scale):
    with pytest.raises(ParameterError, match=r"robot arm|expected positive"):
        RobotArm(arm_lengths(MODEL), HOME, ORIENTATION, scale, reach, (0.25, 0.45), 0.5)
