import casadi
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.phantom import kinematics
from models.phantom.parameters import PREMIUM_1_5


def test_tip_is_at_the_origin_when_all_joints_are_zero():
    assert np.allclose(kinematics.forward_kinematics(np.zeros(3)), 0.0, atol=1e-16)


def test_position_and_jacobian_agree_with_the_compiled_linkage(linkage, configurations):
    jacobian = np.zeros((3, linkage.model.nv))
    for theta in configurations:
        data = linkage.place(theta)
        mujoco.mj_jacSite(linkage.model, data, jacobian, None, linkage.model.site("tip").id)
        closed = np.array(kinematics.jacobian(theta))
        assert np.abs(data.site("tip").xpos - kinematics.forward_kinematics(theta)).max() < 1e-12
        assert np.abs(jacobian @ linkage.closure - closed).max() < 1e-9 * np.abs(closed).max()


def test_jacobian_matches_finite_differences_of_the_position(configurations):
    step = 1e-6
    for theta in configurations[:200]:
        columns = [
            np.subtract(
                kinematics.forward_kinematics(theta + step * axis), kinematics.forward_kinematics(theta - step * axis)
            )
            / (2 * step)
            for axis in np.eye(3)
        ]
        assert np.allclose(np.transpose(columns), kinematics.jacobian(theta), atol=1e-9)


def test_inverse_kinematics_inverts_forward_kinematics_within_the_joint_limits(configurations):
    n_overhead = 0
    for theta in configurations:
        p_P = kinematics.forward_kinematics(theta)
        *found, reachable = kinematics.inverse_kinematics(np.array(p_P))
        n_overhead += p_P[2] < -PREMIUM_1_5.l1
        assert reachable
        assert np.abs(found - theta).max() < 1e-9
    assert n_overhead > 10, "the overhead branch was never sampled"


@pytest.mark.parametrize("p_P", [(1.0, 2.0, 3.0), (0.0, 0.17, -0.215), (0.0, 0.17, -0.2), (0.0, -5.0, 0.0)])
def test_unreachable_points_are_flagged_and_give_finite_angles(p_P):
    *theta, reachable = kinematics.inverse_kinematics(np.array(p_P))
    assert not reachable
    assert np.isfinite(theta).all()
    assert not kinematics.inside_workspace(np.array(p_P))


def test_nan_point_is_outside_the_workspace():
    assert not kinematics.inside_workspace(np.array([np.nan, 0.0, 0.0]))


def test_workspace_is_the_image_of_the_joint_limits(configurations):
    low, high = np.array(PREMIUM_1_5.limit).T
    for theta in configurations[:300]:
        assert kinematics.inside_workspace(np.array(kinematics.forward_kinematics(theta)))
    n_beyond = 0
    # θ3 − θ2 stays within a right angle, where the inverse is unique: a θ beyond a stop is no other θ's image.
    for theta in np.random.default_rng(2).uniform(low - 0.3, high + 0.3, (3000, 3)):
        p_P = np.array(kinematics.forward_kinematics(theta))
        *found, _ = kinematics.inverse_kinematics(p_P)
        if np.abs(found - theta).max() < 1e-9 and not kinematics.within_limits(theta):
            n_beyond += 1
            assert not kinematics.inside_workspace(p_P)
    assert n_beyond > 100


def test_angles_beyond_any_joint_stop_are_outside_the_limits():
    for stop in ((1.6, 0, 0), (0, -1.2, 0.1), (0, 1.2, 0), (0, -0.52, -0.52)):
        assert not kinematics.within_limits(np.array(stop, dtype=float))
    assert kinematics.within_limits(np.array([1.5, -0.4, -0.5]))


def test_joint_torques_have_the_power_of_the_tip_force(configurations):
    rng = np.random.default_rng(3)
    for theta in configurations[:100]:
        force, rate = rng.normal(size=3), rng.normal(size=3)
        power_at_tip = force @ np.array(kinematics.jacobian(theta)) @ rate
        assert np.dot(kinematics.joint_torques(theta, force), rate) == pytest.approx(power_at_tip, abs=1e-14)


def test_the_tip_force_is_the_one_whose_torques_they_are(configurations):
    rng = np.random.default_rng(1)
    for theta in configurations[:100]:
        torque = rng.normal(size=3)
        force = kinematics.force_from_torques(theta, torque, 1e-3)
        np.testing.assert_allclose(kinematics.joint_torques(theta, force), torque, atol=1e-9)
        assert kinematics.force_from_torques(theta, torque, 1.0) == (0.0, 0.0, 0.0)


def test_stylus_orientation_agrees_with_the_compiled_gimbal(linkage, configurations):
    R_HP = np.array(kinematics.R_HP)
    rng = np.random.default_rng(4)
    for theta in configurations[:200]:
        gimbal = rng.uniform(*np.array(PREMIUM_1_5.gimbal_limit).T)
        data = linkage.place(theta, gimbal=gimbal)
        q_HS = np.array(kinematics.stylus_orientation(theta, gimbal))
        R_HS = Rotation.from_quat(q_HS, scalar_first=True).as_matrix()
        assert np.allclose(R_HS, R_HP @ data.site("tip").xmat.reshape(3, 3), atol=1e-12)


def test_gimbal_angles_invert_the_stylus_orientation(configurations):
    rng = np.random.default_rng(5)
    for theta in configurations[:200]:
        gimbal = rng.uniform([-2.5, -1.5, -2.9], [2.5, 1.5, 2.9])
        q_HS = kinematics.stylus_orientation(theta, gimbal)
        assert np.allclose(kinematics.gimbal_angles(theta, q_HS), gimbal, atol=1e-9)


def test_stylus_axes_match_finite_differences_of_the_orientation(configurations):
    rng, step = np.random.default_rng(7), 1e-6
    for theta in configurations[:100]:
        joints = np.concatenate([theta, rng.uniform(*np.array(PREMIUM_1_5.gimbal_limit).T)])
        axes = kinematics.stylus_axes(joints[:3], joints[3:])
        for axis, joint in zip(axes, (0, 2, 3, 4, 5), strict=True):
            turned = [
                Rotation.from_quat(kinematics.stylus_orientation(q[:3], q[3:]), scalar_first=True)
                for q in (joints + step * np.eye(6)[joint], joints - step * np.eye(6)[joint])
            ]
            assert np.allclose((turned[0] * turned[1].inv()).as_rotvec() / (2.0 * step), axis, atol=1e-9)


def test_hand_frame_is_upright_with_x_away_from_the_user():
    R_HP = np.array(kinematics.R_HP)
    assert np.linalg.det(R_HP) == pytest.approx(1.0)
    for axis in np.eye(3):
        assert np.allclose(kinematics.vector_to_hand_frame(axis), R_HP @ axis)
        assert np.allclose(kinematics.vector_to_device_frame(axis), R_HP.T @ axis)
    assert np.allclose(kinematics.vector_to_hand_frame(np.array([0.0, 1.0, 0.0])), [0, 0, 1])
    assert np.allclose(kinematics.vector_to_hand_frame(np.array([0.0, 0.0, 1.0])), [-1, 0, 0])


def test_encoder_readings_are_rounded_to_counts_of_0_03_mm_at_the_tip():
    step = np.array(PREMIUM_1_5.encoder_step)
    theta = np.random.default_rng(6).uniform(-1.0, 1.0, (200, 3))
    for angles in theta:
        reading = np.array(kinematics.encoder_reading(angles))
        assert (np.abs(reading - angles) <= 0.5 * step * (1 + 1e-9)).all()
        assert np.allclose(reading / step, np.round(reading / step), atol=1e-6)
        assert np.abs(np.subtract(kinematics.gimbal_reading(angles), angles)).max() <= 0.5 * kinematics.GIMBAL_STEP
    tip_step = np.linalg.norm(np.array(kinematics.jacobian(np.zeros(3))) * step, axis=0)
    assert tip_step == pytest.approx(0.03e-3, rel=0.25)


@pytest.fixture
def theta_sx():
    casadi.GlobalOptions.setNumpyMode(1)
    return casadi.SX.sym("theta", 3)


@pytest.mark.parametrize("name", ["forward_kinematics", "jacobian", "inverse_kinematics", "encoder_reading"])
def test_symbolic_kinematics_match_the_compiled_kernels(name, theta_sx, configurations):
    kernel = getattr(kinematics, name)
    function = casadi.Function(name, [theta_sx], [casadi.vertcat(*_flat(kernel.py_func(theta_sx)))])
    for theta in configurations[:50]:
        values = np.array(kinematics.forward_kinematics(theta)) if name == "inverse_kinematics" else theta
        assert np.allclose(np.array(function(values)).ravel(), np.ravel(kernel(values)), atol=1e-12)


def test_jacobian_matches_the_symbolic_derivative_of_the_position(theta_sx, configurations):
    position = casadi.vertcat(*_flat(kinematics.forward_kinematics.py_func(theta_sx)))
    derivative = casadi.Function("J", [theta_sx], [casadi.jacobian(position, theta_sx)])
    for theta in configurations[:50]:
        assert np.allclose(np.array(derivative(theta)), kinematics.jacobian(theta), atol=1e-14)


def _flat(value):
    """Scalars of nested tuples, as plain SX: CasADi's NumPy mode wraps what ufuncs return."""
    if isinstance(value, tuple):
        return [scalar for item in value for scalar in _flat(item)]
    return [casadi.SX(value)]
