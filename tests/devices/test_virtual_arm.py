"""A pose and a force of another device, through the Phantom's joints and back."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.safety.faults import Fault
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import forward_kinematics, joint_torques, stylus_orientation
from sim.devices.driver import DriverFault
from sim.devices.virtual_arm import quaternion_of, tip_force, write_pose


def test_the_pose_comes_back_from_the_angles() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        p = rng.uniform(-0.06, 0.06, 3)
        rotation = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3))
        reading = np.zeros(9)
        write_pose(reading, p, rotation.as_matrix())
        np.testing.assert_allclose(forward_kinematics(reading[3:6]), p, atol=1e-12)
        q = np.array(stylus_orientation(reading[3:6], reading[6:9]))
        np.testing.assert_allclose(q * np.sign(q[0]), rotation.as_quat(canonical=True, scalar_first=True), atol=1e-12)


def test_quaternions_agree_with_scipy_s_also_near_half_a_turn() -> None:
    rng = np.random.default_rng(2)
    for angle in [1e-9, 0.1, 2.0, np.pi - 1e-7, np.pi]:
        for _ in range(50):
            axis = rng.normal(size=3)
            rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
            ours = np.array(quaternion_of(rotation.as_matrix()))
            theirs = rotation.as_quat(scalar_first=True)
            assert abs(abs(ours @ theirs) - 1.0) < 1e-12


def test_the_force_is_the_one_that_the_torques_were_made_of() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        reading, force = np.zeros(9), rng.uniform(-3.0, 3.0, 3)
        write_pose(reading, rng.uniform(-0.06, 0.06, 3), np.eye(3))
        theta = tuple(reading[3:6])
        torque = np.add(joint_torques(theta, tuple(force)), gravity_torques(theta))
        np.testing.assert_allclose(tip_force(reading[3:6], torque, 100.0), force, atol=1e-12)
        cut = tip_force(reading[3:6], torque, 1.0)
        assert np.linalg.norm(cut) <= 1.0 + 1e-12
        np.testing.assert_allclose(np.cross(cut, force), 0.0, atol=1e-12)


def test_on_the_turret_s_axis_there_is_no_force() -> None:
    assert not tip_force(np.array([0.0, np.pi / 2.0, 0.0]), np.ones(3), 10.0).any()


@pytest.mark.parametrize("p", [[0.0, 0.0, 5.0], [0.0, -0.6, 0.0]])
def test_where_no_phantom_can_be_is_a_fault(p) -> None:
    reading = np.ones(9)
    with pytest.raises(DriverFault) as refused:
        write_pose(reading, np.array(p), np.eye(3))
    assert refused.value.fault is Fault.LEFT_WORKSPACE
    assert refused.value.value > 0.0
    np.testing.assert_array_equal(reading, np.ones(9))


def test_a_pose_that_is_not_finite_is_a_fault() -> None:
    with pytest.raises(DriverFault) as refused:
        write_pose(np.zeros(9), np.array([0.0, np.nan, 0.0]), np.eye(3))
    assert refused.value.fault is Fault.READING_NOT_FINITE
