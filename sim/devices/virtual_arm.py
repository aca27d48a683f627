r"""A device with other kinematics as a virtual Phantom: joint angles from its pose, its tip force from joint torques.

Vendors' libraries report a pose and take a force at the tip. By the Phantom's inverse kinematics the joint angles are
:math:`\theta = p^{-1}(p_P)`. From the torques :math:`\tau = J^T F + N` that the loop commands follows the tip force

.. math:: F_P = J(\theta)^{-T} (\tau - N(\theta)),

which is exactly the force of the field as long as no torque saturated. N, the gravity torques of the Phantom's linkage,
are subtracted, since such a device compensates for its own weight.
"""

import math

import numpy as np
from numba import njit

from controllers.safety.faults import Fault
from geometry.arrays import Array
from geometry.vectors import Quaternion, Vector
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import (
    Vec3,
    clamped_to_limits,
    force_from_torques,
    forward_kinematics,
    gimbal_angles,
    inverse_kinematics,
    vector_to_hand_frame,
    within_limits,
)
from sim.compilation.compiled import entry_point
from sim.devices.driver import DriverFault
from sim.devices.exchange import READING_GIMBAL, READING_THETA

MIN_SINGULAR_VALUE = 0.05
"""Least singular value of J [m/rad] for which torques are converted into a force; it is zero on the turret's axis,
where J is singular. At θ = 0 it is 0.17."""
MAX_ORTHOGONALITY_ERROR = 1e-3
"""Largest entry of R Rᵀ − 1 that is accepted for an orientation; a matrix rounded to four digits passes."""

_NOT_FINITE, _LEFT_WORKSPACE = int(Fault.READING_NOT_FINITE), int(Fault.LEFT_WORKSPACE)


@njit
def quaternion_of(rotation: Array) -> Quaternion:
    """Unit quaternion wxyz of a rotation matrix (3, 3), with w ≥ 0 (Shepperd 1978: by its largest component)."""
    a, b, c = rotation[0, 0], rotation[1, 1], rotation[2, 2]
    x, y, z = rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    xy, yz, zx = rotation[1, 0] + rotation[0, 1], rotation[2, 1] + rotation[1, 2], rotation[0, 2] + rotation[2, 0]
    # Each is the quaternion times four times its largest component.
    if a + b + c >= max(a, b, c):
        q = 1.0 + a + b + c, x, y, z
    elif a >= max(b, c):
        q = x, 1.0 + a - b - c, xy, zx
    elif b >= c:
        q = y, xy, 1.0 + b - c - a, yz
    else:
        q = z, zx, yz, 1.0 + c - a - b
    scale = math.copysign(1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q[0])
    return scale * q[0], scale * q[1], scale * q[2], scale * q[3]


@njit
def orthogonality_error(matrix: Array) -> float:
    """Deviation of a matrix (3, 3) from a rotation: the largest entry of R Rᵀ − 1, at least 2 for a reflection."""
    largest = 0.0
    for i in range(3):
        for j in range(i + 1):
            product = matrix[i, 0] * matrix[j, 0] + matrix[i, 1] * matrix[j, 1] + matrix[i, 2] * matrix[j, 2]
            largest = max(largest, abs(product - (1.0 if i == j else 0.0)))
    determinant = (
        matrix[0, 0] * (matrix[1, 1] * matrix[2, 2] - matrix[1, 2] * matrix[2, 1])
        + matrix[0, 1] * (matrix[1, 2] * matrix[2, 0] - matrix[1, 0] * matrix[2, 2])
        + matrix[0, 2] * (matrix[1, 0] * matrix[2, 1] - matrix[1, 1] * matrix[2, 0])
    )
    return largest if determinant > 0.0 else max(largest, 2.0)


@njit
def place_stylus(reading: Array, p_P: Vec3, r_HS: Array) -> tuple[int, float]:
    """Write θ and gimbal angles of a pose into a reading; on a fault nothing is written.

    Parameters
    ----------
    reading : Array
        A reading of an `Exchange`, shape (9,).
    p_P, r_HS
        Tip in the device frame [m], and the stylus's orientation in H, shape (3, 3).

    Returns
    -------
    fault : int
        Code of `Fault` if the Phantom cannot take the pose, else 0.
    value : float
        The offending value, in the fault's unit.
    """
    total = p_P[0] + p_P[1] + p_P[2]
    for i in range(3):
        for j in range(3):
            total += r_HS[i, j]
    if not math.isfinite(total):
        return _NOT_FINITE, total
    skewed = orthogonality_error(r_HS)
    if not skewed <= MAX_ORTHOGONALITY_ERROR:
        return _NOT_FINITE, skewed
    a, b, c, reachable = inverse_kinematics(p_P)
    theta = (a, b, c)
    if not reachable or not within_limits(theta):
        x, y, z = forward_kinematics(clamped_to_limits(theta))
        return _LEFT_WORKSPACE, math.sqrt((x - p_P[0]) ** 2 + (y - p_P[1]) ** 2 + (z - p_P[2]) ** 2)
    gimbal = gimbal_angles(theta, quaternion_of(r_HS))
    for i in range(3):
        reading[READING_THETA + i], reading[READING_GIMBAL + i] = theta[i], gimbal[i]
    return 0, 0.0


@entry_point
def place_by_numbers(reading: Array, p_P: Array, r_HS: Array, fault: Array) -> None:
    """`place_stylus` from Python; its result is written to `fault`, shape (2,)."""
    fault[0], fault[1] = place_stylus(reading, (p_P[0], p_P[1], p_P[2]), r_HS)


def write_pose(reading: Array, p_P: Array, r_HS: Array) -> None:
    """Write θ and gimbal angles of a pose into a reading: `place_stylus`.

    Raises
    ------
    DriverFault
        If the Phantom cannot take the pose, the pose is not finite, or the orientation is no rotation.
    """
    fault = np.zeros(2)
    place_by_numbers(reading, np.ascontiguousarray(p_P), np.ascontiguousarray(r_HS), fault)
    if fault[0] != 0.0:
        raise pose_fault(fault[0], fault[1])


def pose_fault(fault: float, value: float) -> DriverFault:
    """The exception for a fault that `place_stylus` returned."""
    skewed = fault == _NOT_FINITE and math.isfinite(value)
    return DriverFault(Fault(int(fault)), value, "an orientation that is no rotation" if skewed else "")


@njit
def tip_force(theta: Vec3, torque: Vec3, largest: float) -> Vector:
    """Force at the tip in the device frame [N] equivalent to joint torques [N m], scaled to at most `largest`.

    Zero where the Jacobian is nearly singular, or the result is not finite.
    """
    gravity = gravity_torques(theta)
    net = torque[0] - gravity[0], torque[1] - gravity[1], torque[2] - gravity[2]
    x, y, z = force_from_torques(theta, net, MIN_SINGULAR_VALUE)
    magnitude = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(magnitude):
        return 0.0, 0.0, 0.0
    scale = largest / magnitude if magnitude > largest else 1.0
    return scale * x, scale * y, scale * z


@entry_point
def force_at_tip(theta: Array, torque: Array, largest: float, force: Array) -> None:
    """`tip_force` from Python, in the hand frame H; written to `force` [N], shape (3,)."""
    f_P = tip_force((theta[0], theta[1], theta[2]), (torque[0], torque[1], torque[2]), largest)
    force[0], force[1], force[2] = vector_to_hand_frame(f_P)
