"""Closed-form kinematics of the Phantom (Çavuşoğlu, Feygin & Tendick 2002): compiled, or symbolic with ``.py_func``.

θ = (θ1, θ2, θ3): turret about y, upper arm above the horizontal, forearm from hanging straight down; θ3 is absolute,
because of the parallelogram. Frame P is the device's: x right, y up, z to the user, origin at the tip for θ = 0. Frame
H has the same origin and the world's axes (x away from the user, y left, z up). S is the stylus: its axes are parallel
to H when all six joints are zero. Arguments may be anything with three elements (array, tuple, CasADi vector), and
results are tuples of scalars, so the same source runs in the servo loop and inside a certificate.
"""

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.vectors import Quaternion, Triple, Vector
from models.phantom.parameters import PREMIUM_1_5

Vec3 = Array | Vector
Matrix3 = tuple[Vector, Vector, Vector]

# numba freezes globals, not attributes of a dataclass.
L1 = PREMIUM_1_5.l1
L2 = PREMIUM_1_5.l2
LIMIT = PREMIUM_1_5.limit
ELBOW_LIMIT = PREMIUM_1_5.elbow_limit
ENCODER_STEP = PREMIUM_1_5.encoder_step
GIMBAL_STEP = 2.0 * np.pi / PREMIUM_1_5.gimbal_counts

R_HP: Matrix3 = ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Rotation from P to H: x_P → −y_H, y_P → z_H, z_P → −x_H."""


@njit
def vector_to_hand_frame(v_P: Vec3) -> Vector:
    """v_H = R_HP v_P, for points (P and H have one origin), velocities and forces alike."""
    return -v_P[2], -v_P[0], v_P[1]


@njit
def vector_to_device_frame(v_H: Vec3) -> Vector:
    """v_P = R_HPᵀ v_H, for points (P and H have one origin), velocities and forces alike."""
    return -v_H[1], v_H[2], -v_H[0]


@njit
def forward_kinematics(theta: Vec3) -> Vector:
    """Position of the gimbal centre.

    x = sin θ1 ρ, y = l2 − l2 cos θ3 + l1 sin θ2, z = −l1 + cos θ1 ρ with ρ = l1 cos θ2 + l2 sin θ3.

    Parameters
    ----------
    theta : three floats
        Joint angles [rad].

    Returns
    -------
    p_P : tuple of three floats
        [m], in the device frame.
    """
    reach = L1 * np.cos(theta[1]) + L2 * np.sin(theta[2])
    return (
        np.sin(theta[0]) * reach,
        L2 - L2 * np.cos(theta[2]) + L1 * np.sin(theta[1]),
        -L1 + np.cos(theta[0]) * reach,
    )


@njit
def jacobian(theta: Vec3) -> Matrix3:
    """J = ∂p_P/∂θ, three rows (x, y, z) of three columns [m/rad]."""
    s1, c1 = np.sin(theta[0]), np.cos(theta[0])
    s2, c2 = np.sin(theta[1]), np.cos(theta[1])
    s3, c3 = np.sin(theta[2]), np.cos(theta[2])
    reach = L1 * c2 + L2 * s3
    # 0.0 * reach, not 0.0, so that every entry is a symbol if θ is symbolic.
    return (
        (c1 * reach, -L1 * s1 * s2, L2 * s1 * c3),
        (0.0 * reach, L1 * c2, L2 * s3),
        (-s1 * reach, -L1 * c1 * s2, L2 * c1 * c3),
    )


@njit
def inverse_kinematics(p_P: Vec3) -> tuple[float, float, float, bool]:
    """Joint angles that put the gimbal centre at a point: the inverse of `forward_kinematics` within the limits.

    With d the distance from the pivot, sin(θ3 − θ2) = (d² − l1² − l2²) / (2 l1 l2). For a point out of reach, the
    angles are those of the straight (or folded) arm pointing at it, and `reachable` is False.

    Parameters
    ----------
    p_P : three floats
        [m], in the device frame.

    Returns
    -------
    theta1, theta2, theta3 : float
        [rad]; −π/2 ≤ θ1 ≤ π/2, −π/2 ≤ θ3 − θ2 ≤ π/2, −π ≤ θ2 < π.
    reachable : bool
        Whether the point is within the reach of the links; joint limits are checked by `within_limits`.
    """
    depth = p_P[2] + L1
    height = p_P[1] - L2
    # |θ1| ≤ π/2, so a point behind the turret's axis is reached overhead, with a negative ρ.
    side = np.copysign(1.0, depth)
    reach = side * np.sqrt(p_P[0] * p_P[0] + depth * depth)
    sine = (reach * reach + height * height - L1 * L1 - L2 * L2) / (2.0 * L1 * L2)
    bend = np.arcsin(np.fmin(1.0, np.fmax(-1.0, sine)))
    theta1 = np.arctan2(side * p_P[0], side * depth)
    # The arm at θ2 = 0 has its tip at (l1 + l2 sin(bend), −l2 cos(bend)); rotated by θ2 it points at the target.
    swing = np.arctan2(height, reach) + np.arctan2(L2 * np.cos(bend), L1 + L2 * np.sin(bend))
    theta2 = swing - 2.0 * np.pi * np.floor((swing + np.pi) / (2.0 * np.pi))
    return theta1, theta2, theta2 + bend, np.fabs(sine) <= 1.0


@njit
def linkage_angles(theta: Vec3) -> tuple[float, float, float, float, float]:
    """θ1, θ2, θ3, elbow θ3 − θ2 and twin θ2 − θ3: the joints that `models.phantom.spec` names; rates likewise."""
    return theta[0], theta[1], theta[2], theta[2] - theta[1], theta[1] - theta[2]


@njit
def within_limits(theta: Vec3) -> bool:
    """Whether joint angles [rad] are within the limits of θ1, θ2, θ3 and, due to the parallelogram, of θ3 − θ2."""
    bend = theta[2] - theta[1]
    return (
        LIMIT[0][0] <= theta[0] <= LIMIT[0][1]
        and LIMIT[1][0] <= theta[1] <= LIMIT[1][1]
        and LIMIT[2][0] <= theta[2] <= LIMIT[2][1]
        and ELBOW_LIMIT[0] <= bend <= ELBOW_LIMIT[1]
    )


@njit
def clamped_to_limits(theta: Vec3) -> Triple:
    """Joint angles [rad] brought within the limits, the upper arm's before the forearm's."""
    turret = min(max(theta[0], LIMIT[0][0]), LIMIT[0][1])
    upper = min(max(theta[1], LIMIT[1][0], LIMIT[2][0] - ELBOW_LIMIT[1]), LIMIT[1][1], LIMIT[2][1] - ELBOW_LIMIT[0])
    fore = min(max(theta[2], LIMIT[2][0], upper + ELBOW_LIMIT[0]), LIMIT[2][1], upper + ELBOW_LIMIT[1])
    return turret, upper, fore


@njit
def inside_workspace(p_P: Vec3) -> bool:
    """Whether the gimbal centre can be at a point of the device frame [m] with all joints within their limits."""
    theta1, theta2, theta3, reachable = inverse_kinematics(p_P)
    return reachable and within_limits((theta1, theta2, theta3))


@njit
def joint_torques(theta: Vec3, f_P: Vec3) -> Triple:
    """τ = Jᵀ F: torques at the joints [N m] that give the force F at the tip [N], in the device frame."""
    j = jacobian(theta)
    return (
        j[0][0] * f_P[0] + j[1][0] * f_P[1] + j[2][0] * f_P[2],
        j[0][1] * f_P[0] + j[1][1] * f_P[1] + j[2][1] * f_P[2],
        j[0][2] * f_P[0] + j[1][2] * f_P[1] + j[2][2] * f_P[2],
    )


@njit
def min_singular_value(theta: Vec3) -> float:
    """Least singular value of J(θ) [m/rad].

    The turret moves the tip sideways, with the tip's distance |ρ| from the turret's axis as lever arm; upper arm and
    forearm move it in their plane, at right angles to that. So the singular values of J are |ρ| and those of the 2×2
    matrix of the two links, whose determinant is l1 l2 cos(θ3 − θ2).
    """
    reach = L1 * np.cos(theta[1]) + L2 * np.sin(theta[2])
    elbow_angle = theta[2] - theta[1]
    mean, half, cross = 0.5 * (L1 * L1 + L2 * L2), 0.5 * (L1 * L1 - L2 * L2), L1 * L2 * np.sin(elbow_angle)
    largest = np.sqrt(mean + np.sqrt(half * half + cross * cross))
    return min(abs(reach), abs(L1 * L2 * np.cos(elbow_angle)) / largest)


@njit
def force_from_torques(theta: Vec3, torque: Vec3, least: float) -> Vector:
    """F = J⁻ᵀ τ: force at the tip [N] equivalent to torques at the joints [N m], in the device frame.

    The inverse of `joint_torques`; zero where `min_singular_value` is below `least` [m/rad].
    """
    if min_singular_value(theta) < least:
        return 0.0, 0.0, 0.0
    s1, c1 = np.sin(theta[0]), np.cos(theta[0])
    s2, c2 = np.sin(theta[1]), np.cos(theta[1])
    s3, c3 = np.sin(theta[2]), np.cos(theta[2])
    upper, fore, sideways = torque[1] / L1, torque[2] / L2, torque[0] / (L1 * c2 + L2 * s3)
    cos_bend = np.cos(theta[2] - theta[1])
    up, outwards = (c3 * upper + s2 * fore) / cos_bend, (c2 * fore - s3 * upper) / cos_bend
    return c1 * sideways + s1 * outwards, up, c1 * outwards - s1 * sideways


@njit
def stylus_orientation(theta: Vec3, gimbal: Vec3) -> Quaternion:
    """Orientation of the stylus in the hand frame.

    R_HS = R_z(θ1) R_y(θ3) R_z(g1) R_y(g2) R_x(g3): the forearm, then yaw about it, pitch, and roll about the pen.

    Parameters
    ----------
    theta, gimbal : three floats each
        Joint angles and gimbal angles [rad].

    Returns
    -------
    q_HS : tuple of four floats
        Unit quaternion wxyz.
    """
    s1, c1 = np.sin(0.5 * theta[0]), np.cos(0.5 * theta[0])
    s3, c3 = np.sin(0.5 * theta[2]), np.cos(0.5 * theta[2])
    sy, cy = np.sin(0.5 * gimbal[0]), np.cos(0.5 * gimbal[0])
    sp, cp = np.sin(0.5 * gimbal[1]), np.cos(0.5 * gimbal[1])
    sr, cr = np.sin(0.5 * gimbal[2]), np.cos(0.5 * gimbal[2])
    aw, ax, ay, az = c1 * c3, -s1 * s3, c1 * s3, s1 * c3
    # Rotation of the gimbal, intrinsic z–y–x.
    gw = cy * cp * cr + sy * sp * sr
    gx = cy * cp * sr - sy * sp * cr
    gy = cy * sp * cr + sy * cp * sr
    gz = sy * cp * cr - cy * sp * sr
    return (
        aw * gw - ax * gx - ay * gy - az * gz,
        aw * gx + ax * gw + ay * gz - az * gy,
        aw * gy - ax * gz + ay * gw + az * gx,
        aw * gz + ax * gy - ay * gx + az * gw,
    )


@njit
def stylus_axes(theta: Vec3, gimbal: Vec3) -> tuple[Vector, Vector, Vector, Vector, Vector]:
    """Rotation axes of the stylus in H for θ1, θ3, g1, g2, g3: ω = Σ a_j q̇_j, the Jacobian of `stylus_orientation`.

    Parameters
    ----------
    theta, gimbal : three floats each
        Joint angles and gimbal angles [rad].
    """
    s1, c1 = np.sin(theta[0]), np.cos(theta[0])
    s3, c3 = np.sin(theta[2]), np.cos(theta[2])
    sy, cy = np.sin(gimbal[0]), np.cos(gimbal[0])
    sp, cp = np.sin(gimbal[1]), np.cos(gimbal[1])
    # Axes of the forearm, R_z(θ1) R_y(θ3): forwards, left, up along it.
    ahead, left, up = (c1 * c3, s1 * c3, -s3), (-s1, c1, 0.0 * s1), (c1 * s3, s1 * s3, c3)
    pitch = (cy * left[0] - sy * ahead[0], cy * left[1] - sy * ahead[1], cy * left[2] - sy * ahead[2])
    level = (cy * ahead[0] + sy * left[0], cy * ahead[1] + sy * left[1], cy * ahead[2] + sy * left[2])
    pen = (cp * level[0] - sp * up[0], cp * level[1] - sp * up[1], cp * level[2] - sp * up[2])
    return (0.0 * s1, 0.0 * s1, 1.0 + 0.0 * s1), left, up, pitch, pen


@njit
def gimbal_angles(theta: Vec3, q_HS: Quaternion) -> Triple:
    """Inverse of `stylus_orientation`: gimbal angles that turn the stylus to q_HS, with −π/2 ≤ g2 ≤ π/2 [rad]."""
    s1, c1 = np.sin(0.5 * theta[0]), np.cos(0.5 * theta[0])
    s3, c3 = np.sin(0.5 * theta[2]), np.cos(0.5 * theta[2])
    aw, ax, ay, az = c1 * c3, s1 * s3, -c1 * s3, -s1 * c3
    w = aw * q_HS[0] - ax * q_HS[1] - ay * q_HS[2] - az * q_HS[3]
    x = aw * q_HS[1] + ax * q_HS[0] + ay * q_HS[3] - az * q_HS[2]
    y = aw * q_HS[2] - ax * q_HS[3] + ay * q_HS[0] + az * q_HS[1]
    z = aw * q_HS[3] + ax * q_HS[2] - ay * q_HS[1] + az * q_HS[0]
    return (
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        np.arcsin(np.fmin(1.0, np.fmax(-1.0, 2.0 * (w * y - x * z)))),
        np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
    )


@njit
def encoder_reading(theta: Vec3) -> Triple:
    """Joint angles as measured by the motor encoders: rounded to the nearest count [rad]."""
    return (
        ENCODER_STEP[0] * np.rint(theta[0] / ENCODER_STEP[0]),
        ENCODER_STEP[1] * np.rint(theta[1] / ENCODER_STEP[1]),
        ENCODER_STEP[2] * np.rint(theta[2] / ENCODER_STEP[2]),
    )


@njit
def gimbal_reading(gimbal: Vec3) -> Triple:
    """Gimbal angles as measured by their encoders: rounded to the nearest count [rad]."""
    return (
        GIMBAL_STEP * np.rint(gimbal[0] / GIMBAL_STEP),
        GIMBAL_STEP * np.rint(gimbal[1] / GIMBAL_STEP),
        GIMBAL_STEP * np.rint(gimbal[2] / GIMBAL_STEP),
    )
