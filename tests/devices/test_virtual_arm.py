"""Poses and forces of other devices, converted to the Phantom's joints and back."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.safety.faults import Fault
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import (
    forward_kinematics,
    jacobian,
    joint_torques,
    min_singular_value,
    stylus_orientation,
)
from sim.devices.driver import DriverFault
from sim.devices.virtual_arm import (
    MAX_ORTHOGONALITY_ERROR,
    MIN_SINGULAR_VALUE,
    orthogonality_error,
    quaternion_of,
    tip_force,
    write_pose,
)


def test_forward_kinematics_of_written_angles_gives_the_pose() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        p = rng.uniform(-0.06, 0.06, 3)
        rotation = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3))
        reading = np.zeros(9)
        write_pose(reading, p, rotation.as_matrix())
        np.testing.assert_allclose(forward_kinematics(reading[3:6]), p, atol=1e-12)
        q = np.array(stylus_orientation(reading[3:6], reading[6:9]))
        np.testing.assert_allclose(q * np.sign(q[0]), rotation.as_quat(canonical=True, scalar_first=True), atol=1e-12)


@pytest.mark.parametrize("angle", [None, 1e-9, 0.1, 2.0, np.pi - 1e-7, np.pi])
def test_quaternions_equal_scipy_also_at_half_a_turn(angle) -> None:
    rng = np.random.default_rng(2)
    for k in range(300):
        axis = np.eye(3)[k] if k < 3 else rng.normal(size=3)
        rotation = Rotation.random(rng=rng)
        if angle is not None:
            rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        ours, theirs = np.array(quaternion_of(rotation.as_matrix())), rotation.as_quat(scalar_first=True)
        np.testing.assert_allclose(ours * np.sign(ours @ theirs), theirs, atol=1e-14)
        assert ours[0] >= 0.0
        assert orthogonality_error(rotation.as_matrix()) < 1e-14


def test_tip_force_inverts_joint_torques_and_is_limited() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        reading, force = np.zeros(9), rng.uniform(-3.0, 3.0, 3)
        write_pose(reading, rng.uniform(-0.06, 0.06, 3), np.eye(3))
        theta = tuple(reading[3:6])
        torque = tuple(np.add(joint_torques(theta, tuple(force)), gravity_torques(theta)))
        np.testing.assert_allclose(tip_force(theta, torque, 100.0), force, atol=1e-12)
        limited = tip_force(theta, torque, 1.0)
        assert np.linalg.norm(limited) <= 1.0 + 1e-12
        np.testing.assert_allclose(np.cross(limited, force), 0.0, atol=1e-12)


def test_closed_form_force_and_gain_equal_linear_algebra_over_the_workspace() -> None:
    rng, singular = np.random.default_rng(4), 0
    for _ in range(2000):
        theta, torque = tuple(rng.uniform(-1.6, 1.6, 3)), rng.normal(size=3)
        j = np.array(jacobian(theta))
        least = np.linalg.svd(j, compute_uv=False)[-1]
        assert min_singular_value(theta) == pytest.approx(least, abs=1e-15)
        expected = np.linalg.solve(j.T, torque - gravity_torques(theta)) if least >= MIN_SINGULAR_VALUE else np.zeros(3)
        np.testing.assert_allclose(tip_force(theta, tuple(torque), 1e9), expected, rtol=1e-12, atol=1e-12)
        singular += least < MIN_SINGULAR_VALUE
    assert 100 < singular < 1900


def test_force_is_zero_on_the_turret_axis() -> None:
    assert tip_force((0.0, np.pi / 2.0, 0.0), (1.0, 1.0, 1.0), 10.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("torque", [1e153, 1e160, 1e308, np.inf, np.nan])
def test_force_is_finite_and_limited_for_huge_torques(torque: float) -> None:
    force = tip_force((0.1, 0.2, 0.3), (torque, -torque, torque), 8.5)
    assert np.linalg.norm(force) <= 8.5 * (1.0 + 1e-12)


# Beyond the links' reach, and within it but beyond a limit of the upper arm, the forearm or the elbow.
@pytest.mark.parametrize(
    "p", [[0.0, 0.0, 5.0], [0.0, -0.6, 0.0], [0.08, -0.14, -0.28], [0.26, 0.19, -0.3], [-0.23, 0.1, 0.09]]
)
def test_point_outside_the_workspace_is_a_fault_that_says_how_far(p) -> None:
    reading = np.ones(9)
    with pytest.raises(DriverFault) as refused:
        write_pose(reading, np.array(p), np.eye(3))
    assert refused.value.fault is Fault.LEFT_WORKSPACE
    assert refused.value.value > 0.01
    np.testing.assert_array_equal(reading, np.ones(9))


def test_pose_that_is_not_finite_is_a_fault() -> None:
    with pytest.raises(DriverFault) as refused:
        write_pose(np.zeros(9), np.array([0.0, np.nan, 0.0]), np.eye(3))
    assert refused.value.fault is Fault.READING_NOT_FINITE


TURN = Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()
NO_ROTATIONS = {
    "zero": 0.0 * TURN,
    "a reflection": TURN @ np.diag([1.0, 1.0, -1.0]),
    "point inversion": -TURN,
    "twice as long": 2.0 * TURN,
    "a row twice": TURN[[0, 1, 1]],
    "sheared": TURN @ (np.eye(3) + 2.1 * MAX_ORTHOGONALITY_ERROR * np.eye(3, k=1)),
    "beyond all numbers": 1e200 * TURN,
}


@pytest.mark.parametrize("name", NO_ROTATIONS)
def test_orientation_that_is_no_rotation_is_a_fault(name) -> None:
    reading = np.ones(9)
    with pytest.raises(DriverFault) as refused:
        write_pose(reading, np.zeros(3), NO_ROTATIONS[name])
    assert refused.value.fault is Fault.READING_NOT_FINITE
    assert refused.value.value > MAX_ORTHOGONALITY_ERROR
    np.testing.assert_array_equal(reading, np.ones(9))


def test_rounded_rotation_matrix_is_accepted() -> None:
    reading, exact = np.zeros(9), np.zeros(9)
    write_pose(reading, np.zeros(3), np.round(TURN, 4))
    write_pose(exact, np.zeros(3), TURN)
    np.testing.assert_allclose(reading, exact, atol=3e-4)
