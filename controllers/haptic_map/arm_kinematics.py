r"""Closed-form inverse kinematics of an arm with seven joints, and its differential.

The shoulder is spherical (axes z, y, z), then comes an elbow (y), then a spherical wrist (z, y, z). With x the vector
from shoulder to wrist, of length D, azimuth a and angle e from the vertical, and l_1, l_2 the lengths of upper arm and
forearm,

.. math:: \cos q_4 = \frac{D^2 - l_1^2 - l_2^2}{2 l_1 l_2}, \quad
          \beta = \operatorname{atan2}(l_2 \sin q_4,\, l_1 + l_2 \cos q_4), \quad
          R_{03} = R_z(a)\,R_y(e)\,R_z(\psi)\,R_y(-\beta)

and the angles of shoulder and wrist are those of R_03 and R_04ᵀ R_T, with R_T the orientation of the tool. The
redundant degree of freedom is the arm angle ψ (Kreutz-Delgado, Long & Seraji 1992), the turn of the elbow about x away
from the vertical plane; it is given, so that a closed path of the tool is a closed path of the joints.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.vectors import Quaternion, Vector, product, turned, turned_back


@njit
def _rotation_about_y(angle: float) -> Quaternion:
    return np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0


@njit
def _rotation_about_z(angle: float) -> Quaternion:
    return np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)


@njit
def _wrap_angle(angle: float) -> float:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


@njit
def _zyz_angles(q: Quaternion, sign: float) -> Vector:
    """Angles a, b, c of R_z(a) R_y(b) R_z(c), with b of a given sign; at b = 0 only a + c is defined."""
    w, x, y, z = q
    total, difference = np.arctan2(z, w), np.arctan2(-sign * x, sign * y)
    b = 2.0 * np.arctan2(np.sqrt(x * x + y * y), np.sqrt(w * w + z * z))
    return _wrap_angle(total + difference), sign * b, _wrap_angle(total - difference)


@njit
def _zyz_rates(a: float, b: float, omega: Vector) -> Vector:
    """Rates of the three angles for an angular velocity in the fixed frame of the first rotation."""
    sine, cosine = np.sin(a), np.cos(a)
    rate_c = (cosine * omega[0] + sine * omega[1]) / np.copysign(max(abs(np.sin(b)), 1e-9), b)
    return omega[2] - np.cos(b) * rate_c, cosine * omega[1] - sine * omega[0], rate_c


class ArmPosture(NamedTuple):
    """An arm that reaches for a point with its wrist: the quantities of the module's equations.

    Attributes
    ----------
    wrist : (float, float, float)
        x [m], of length D.
    flat : float
        Length of its horizontal part [m].
    upper, fore : float
        l_1 and l_2 [m].
    sine, cosine : float
        Of q_4.
    swivel, shoulder, arm : Quaternion
        R_z(a) R_y(e) R_z(ψ), R_03 and R_04.
    elevation_axis : (float, float, float)
        Axis of R_y(e): y, turned by R_z(a).
    """

    wrist: Vector
    flat: float
    upper: float
    fore: float
    sine: float
    cosine: float
    swivel: Quaternion
    shoulder: Quaternion
    arm: Quaternion
    elevation_axis: Vector


@njit
def bend_arm(wrist: Vector, tool: Quaternion, upper: float, fore: float, arm_angle: float, q: Array) -> ArmPosture:
    """Write the joint angles q (7,) [rad] for a wrist at x [m] from the shoulder and the orientation R_T of the tool.

    Out of reach the arm is stretched straight.
    """
    px, py, pz = wrist
    flat2 = px * px + py * py
    flat, square = np.sqrt(flat2), flat2 + pz * pz
    azimuth, elevation = np.arctan2(py, px), np.arctan2(flat, pz)
    cosine = (square - upper * upper - fore * fore) / (2.0 * upper * fore)
    cosine = min(1.0, max(-1.0, cosine))
    sine = np.sqrt(1.0 - cosine * cosine)
    elbow = np.arctan2(sine, cosine)
    beta = np.arctan2(fore * sine, upper + fore * cosine)
    to_wrist = product(_rotation_about_z(azimuth), _rotation_about_y(elevation))
    swivel = product(to_wrist, _rotation_about_z(arm_angle))
    shoulder = product(swivel, _rotation_about_y(-beta))
    arm = product(shoulder, _rotation_about_y(elbow))
    hand = product((arm[0], -arm[1], -arm[2], -arm[3]), tool)
    q[0], q[1], q[2] = _zyz_angles(shoulder, 1.0)
    q[3] = elbow
    q[4], q[5], q[6] = _zyz_angles(hand, -1.0)
    elevation_axis = turned(_rotation_about_z(azimuth), (0.0, 1.0, 0.0))
    return ArmPosture(wrist, flat, upper, fore, sine, cosine, swivel, shoulder, arm, elevation_axis)


@njit
def arm_rates(posture: ArmPosture, q: Array, v: Vector, omega: Vector, rates: Array) -> None:
    """Write the joint rates (7,) [rad/s] for a wrist with velocity v [m/s] and a tool with angular velocity ω [rad/s].

    `q` are the angles that `bend_arm` wrote.
    """
    px, py, pz = posture.wrist
    flat, upper, fore, sine, cosine = posture.flat, posture.upper, posture.fore, posture.sine, posture.cosine
    flat2 = px * px + py * py
    square = flat2 + pz * pz
    rate_azimuth = (px * v[1] - py * v[0]) / flat2
    rate_flat = (px * v[0] + py * v[1]) / flat
    rate_elevation = (pz * rate_flat - flat * v[2]) / square
    rate_cosine = (px * v[0] + py * v[1] + pz * v[2]) / (upper * fore)
    rate_elbow = -rate_cosine / max(sine, 1e-9)
    # β = atan2(s, c) with s² + c² = D²: β' = (c s' − s c')/D².
    along = upper + fore * cosine
    rate_beta = (along * fore * cosine * rate_elbow - fore * sine * fore * rate_cosine) / square
    y_elevation, y_beta = posture.elevation_axis, turned(posture.swivel, (0.0, 1.0, 0.0))
    y_elbow = turned(posture.shoulder, (0.0, 1.0, 0.0))
    w_shoulder = (
        rate_elevation * y_elevation[0] - rate_beta * y_beta[0],
        rate_elevation * y_elevation[1] - rate_beta * y_beta[1],
        rate_azimuth + rate_elevation * y_elevation[2] - rate_beta * y_beta[2],
    )
    w_wrist = (
        omega[0] - w_shoulder[0] - rate_elbow * y_elbow[0],
        omega[1] - w_shoulder[1] - rate_elbow * y_elbow[1],
        omega[2] - w_shoulder[2] - rate_elbow * y_elbow[2],
    )
    rates[0], rates[1], rates[2] = _zyz_rates(q[0], q[1], w_shoulder)
    rates[3] = rate_elbow
    rates[4], rates[5], rates[6] = _zyz_rates(q[4], q[5], turned_back(posture.arm, w_wrist))
