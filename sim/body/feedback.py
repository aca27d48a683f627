"""The wanted acceleration of the figure: feedforward of the reference, and critically damped feedback."""

import numpy as np
from numba import njit

from geometry.arrays import Array
from sim.body.figure_state import FigureState


@njit
def rotation_error(q: Array, q_r: Array, error: Array) -> None:
    """Write the rotation vector of q⁻¹ q_r, in the frame of q, to `error` (3,) [rad]; unit quaternions wxyz (4,)."""
    w = q[0] * q_r[0] + q[1] * q_r[1] + q[2] * q_r[2] + q[3] * q_r[3]
    x = q[0] * q_r[1] - q[1] * q_r[0] - q[2] * q_r[3] + q[3] * q_r[2]
    y = q[0] * q_r[2] - q[2] * q_r[0] - q[3] * q_r[1] + q[1] * q_r[3]
    z = q[0] * q_r[3] - q[3] * q_r[0] - q[1] * q_r[2] + q[2] * q_r[1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * np.arctan2(sine, w) / sine
    error[0], error[1], error[2] = scale * x, scale * y, scale * z


@njit
def rotate_by_vector(rotation: Array, vector: Array, out: Array) -> None:
    """Rotate a vector by a rotation vector, out = exp(rotation) vector (Rodrigues), all of shape (3,)."""
    angle = np.sqrt(rotation[0] ** 2 + rotation[1] ** 2 + rotation[2] ** 2)
    a = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    b = 0.5 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    cx = rotation[1] * vector[2] - rotation[2] * vector[1]
    cy = rotation[2] * vector[0] - rotation[0] * vector[2]
    cz = rotation[0] * vector[1] - rotation[1] * vector[0]
    out[0] = vector[0] + a * cx + b * (rotation[1] * cz - rotation[2] * cy)
    out[1] = vector[1] + a * cy + b * (rotation[2] * cx - rotation[0] * cz)
    out[2] = vector[2] + a * cz + b * (rotation[0] * cy - rotation[1] * cx)


@njit
def limit_length(vector: Array, longest: float) -> bool:
    """Scale a vector of shape (3,) down to at most a length, in place; returns whether it was longer."""
    length = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if length > longest:
        vector *= longest / length
    return length > longest


@njit
def wanted_acceleration(s: FigureState, q_r: Array, v_r: Array, a_r: Array) -> None:
    """Write a* = a_r + 2ω (v_r − v) + ω² (q_r ⊖ q) to `s.acceleration`.

    Angular v_r and a_r are rotated by the orientation error from the reference's frame to that of the joint. Errors
    and accelerations are saturated at the limits in the gains.

    Parameters
    ----------
    s : FigureState
        State and gains are read.
    q_r, v_r, a_r : Array
        Reference pose (75), velocity (57) and acceleration (57), in the conventions of qpos and qvel.
    """
    a, gains = s.acceleration, s.gains
    error, rotated = s.rotation[0], s.rotation[1]
    rate = gains.root_rate
    for i in range(3):
        a[i] = 2.0 * rate * (v_r[i] - s.qvel[i]) + rate**2 * (q_r[i] - s.qpos[i])
    limit_length(a[:3], gains.max_root_acceleration)
    rotated[:] = a_r[:3]
    limit_length(rotated, gains.linear_limit)
    a[:3] += rotated
    for body in range(s.xpos.shape[0]):
        rate = gains.root_rate if body == 0 else gains.joint_rate
        p, t = 3 + 4 * body, 3 + 3 * body
        rotation_error(s.qpos[p : p + 4], q_r[p : p + 4], error)
        rotate_by_vector(error, v_r[t : t + 3], rotated)
        size = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        stiffness = rate**2 * min(1.0, gains.joint_reach / max(size, 1e-12))
        for i in range(3):
            a[t + i] = 2.0 * rate * (rotated[i] - s.qvel[t + i]) + stiffness * error[i]
        if body == 0:
            limit_length(a[3:6], gains.max_root_angular_acceleration)
        rotate_by_vector(error, a_r[t : t + 3], rotated)
        limit_length(rotated, gains.angular_limit)
        a[t : t + 3] += rotated
