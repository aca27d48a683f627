r"""A device of another build, taken as a Phantom: joints that put the stylus where it is, and its force from torques.

Libraries of vendors tell a pose and take a force at the tip. With the Phantom's own kinematics the angles are
:math:`\theta = p^{-1}(p_P)`, and the torques :math:`\tau = J^T F + N` that the loop commands give back

.. math:: F_P = J(\theta)^{-T} (\tau - N(\theta)),

exactly the force that the field asked for, as long as no torque was cut. N, the weight of the Phantom's linkage, is
left out: such a device carries its own.
"""

import numpy as np

from controllers.safety.faults import Fault
from controllers.state import Array
from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import forward_kinematics, gimbal_angles, inverse_kinematics, jacobian, within_limits
from sim.devices.driver import DriverFault
from sim.devices.exchange import READING_GIMBAL, READING_THETA

WEAKEST = 0.05
"""Least singular value of J [m/rad] for which a torque is turned into a force: on the turret's axis, where it is zero,
no torque gives one. The Phantom's is 0.17 at θ = 0."""


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """Unit quaternion wxyz of a rotation matrix (3, 3), with w ≥ 0 (Shepperd 1978: by its largest component)."""
    trace = float(np.trace(rotation))
    squares = np.array([trace, *(2.0 * np.diag(rotation) - trace)])
    i = int(np.argmax(squares))
    skew = (rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    q = np.empty(4)
    q[i] = 1.0 + squares[i]
    if i == 0:
        q[1:] = skew
    else:
        j, k = i % 3 + 1, (i + 1) % 3 + 1
        q[0] = skew[i - 1]
        q[j] = rotation[j - 1, i - 1] + rotation[i - 1, j - 1]
        q[k] = rotation[k - 1, i - 1] + rotation[i - 1, k - 1]
    q *= (1.0 if q[0] >= 0.0 else -1.0) / np.linalg.norm(q)
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])


def write_pose(reading: Array, p_P: Array, r_HS: Array) -> None:
    """Write θ and gimbal angles of a pose into a reading.

    Parameters
    ----------
    reading : Array
        Of an `Exchange`, shape (9,).
    p_P, r_HS : Array
        Tip in the device frame [m], shape (3,), and the stylus's orientation in H, shape (3, 3).

    Raises
    ------
    DriverFault
        If the Phantom cannot be there, or the pose is not finite.
    """
    if not (np.all(np.isfinite(p_P)) and np.all(np.isfinite(r_HS))):
        raise DriverFault(Fault.READING_NOT_FINITE, float(np.sum(p_P) + np.sum(r_HS)))
    a, b, c, reachable = inverse_kinematics((p_P[0], p_P[1], p_P[2]))
    theta = (a, b, c)
    if not reachable or not within_limits(theta):
        raise DriverFault(Fault.LEFT_WORKSPACE, float(np.linalg.norm(np.subtract(forward_kinematics(theta), p_P))))
    reading[READING_THETA : READING_THETA + 3] = theta
    reading[READING_GIMBAL : READING_GIMBAL + 3] = gimbal_angles(theta, quaternion_of(r_HS))


def tip_force(theta: Array, torque: Array, largest: float) -> Array:
    """Force at the tip in the device frame [N], shape (3,), for torques of the joints [N m], at most `largest`.

    Zero where the Jacobian is nearly singular.
    """
    angles = (theta[0], theta[1], theta[2])
    j = np.array(jacobian(angles))
    if np.linalg.svd(j, compute_uv=False)[-1] < WEAKEST:
        return np.zeros(3)
    force: Array = np.linalg.solve(j.T, torque - np.array(gravity_torques(angles))).astype(np.float64)
    size = float(np.linalg.norm(force))
    return force * (largest / size) if size > largest else force
