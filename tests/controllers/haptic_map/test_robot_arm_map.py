"""The map to a robot arm: MuJoCo's forward kinematics agrees, limits hold everywhere, the derivative is one."""

import mujoco
import numpy as np
import pytest

from controllers.errors import ParameterError
from controllers.haptic_map.robot_arm import RobotArm
from controllers.rotations import exponential, multiply
from experiments.setups.maps.robot_arm import HOME, ORIENTATION, robot_arm_map
from models.robot_arm.spec import TOOL, arm_lengths, arm_limits, arm_model
from tests.controllers.clips_for_maps import assert_same_compiled

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


def test_the_tool_is_where_the_stylus_leads_it():
    rng = np.random.default_rng(1)
    for _ in range(1000):
        x = random_stylus(rng, 0.07, np.radians(15.0))
        place, quaternion = tool_pose(MAP.pose(x))
        np.testing.assert_allclose(place, HOME + SCALE * x[:3], atol=1e-9)
        wanted = np.array(multiply(*x[3:], *ORIENTATION))
        assert 1.0 - abs(quaternion @ wanted) < 1e-12


def test_no_joint_leaves_its_limits_wherever_the_stylus_is():
    rng = np.random.default_rng(2)
    limits = arm_limits(MODEL)
    poses = np.array([MAP.pose(random_stylus(rng, 0.4, 3.1)) for _ in range(3000)])
    assert np.all(poses > limits[:, 0] + np.radians(5.0))
    assert np.all(poses < limits[:, 1] - np.radians(5.0))


def test_far_outside_the_arm_stays_at_the_edge():
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        x = np.concatenate([1e6 * direction, [1.0, 0.0, 0.0, 0.0]])
        place, _ = tool_pose(MAP.pose(x))
        np.testing.assert_allclose(place, HOME + SCALE * 0.1 * direction, atol=1e-6)


def test_the_derivative_agrees_with_differences():
    rng = np.random.default_rng(3)
    step = 1e-5
    for _ in range(1000):
        x = random_stylus(rng, 0.15, 2.0)
        jacobian = MAP.jacobian(x)
        differences = np.empty((7, 6))
        for j in range(6):
            sides = []
            for h in (step, -step, 2.0 * step, -2.0 * step):
                moved = x.copy()
                if j < 3:
                    moved[j] += h
                else:
                    moved[3:] = multiply(*exponential(*(h * np.eye(3)[j - 3])), *x[3:])
                sides.append(MAP.pose(moved))
            differences[:, j] = (8.0 * (sides[0] - sides[1]) - (sides[2] - sides[3])) / (12.0 * step)
        assert np.linalg.norm(jacobian - differences) <= 1e-6 * np.linalg.norm(differences)


def test_it_is_smooth_over_the_edge_of_its_domain():
    """Second differences along lines through the edge have no jump: h is C² there."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        x = random_stylus(rng, 0.02, 0.1)
        direction = rng.normal(size=3)
        s = np.linspace(0.0, 0.15, 3001)
        path = np.hstack([x[:3] + s[:, None] * direction / np.linalg.norm(direction), np.tile(x[3:], (len(s), 1))])
        second = np.diff(np.array([MAP.pose(point) for point in path]), 2, axis=0) / (s[1] - s[0]) ** 2
        assert np.abs(np.diff(second, axis=0)).max() < 0.05 * np.ptp(second, axis=0).max()


def test_the_servo_evaluates_the_same_map():
    assert_same_compiled(MAP, random_stylus(np.random.default_rng(5), 0.2, 1.0))


def test_a_domain_that_the_arm_cannot_serve_is_refused_with_the_place():
    with pytest.raises(ParameterError, match=r"cannot follow a stylus at .* mm turned by"):
        RobotArm(arm_lengths(MODEL), HOME, ORIENTATION, 6.0, (0.07, 0.1), (0.25, 0.45), 0.5).check_domain(LIMITS)


@pytest.mark.parametrize(("reach", "scale"), [((0.1, 0.1), 1.0), ((0.07, 0.1), -1.0), ((0.07, np.nan), 1.0)])
def test_numbers_out_of_their_interval_are_refused(reach, scale):
    with pytest.raises(ParameterError, match=r"robot arm|expected positive"):
        RobotArm(arm_lengths(MODEL), HOME, ORIENTATION, scale, reach, (0.25, 0.45), 0.5)
