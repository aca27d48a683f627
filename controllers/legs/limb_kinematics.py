r"""Closed-form inverse kinematics of a limb: feet of a blend are placed at the mean of their poses in the clips.

A mean of joint angles does not control the feet. So the pose of a limb's end (a foot) is blended like root and joints,
and the limb's three joints are corrected in closed form so that its end has exactly this pose:

- the middle joint turns by δ about its flexion axis, the law of cosines in the form A + B cos δ + C sin δ = D²;
- the first joint turns the shortest way, until the last joint lies in the required direction;
- the last joint gives the end its blended orientation.

With D the required distance of the last joint from the first, c = (D² − A)/√(B² + C²) the cosine of the required
flexion and c₀ that of the blended joints, δ = f(c) − f(c₀); f is the arc cosine, levelled off near ±1 with two
continuous derivatives. A limb whose target is out of reach stays short of straight, by a millimetre for a human leg,
and moves smoothly. δ is zero where nothing is to be corrected, however straight the limb: a clip alone is unchanged. In
the air, joints are kept within their limits (`joint_limits`).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.legs.joint_limits import saturate_joint
from controllers.legs.limbs import AXIS, CENTRE, FIRST, LAST, LIMB_SIZE, LIMITS, MIDDLE, OFFSETS, SHANK, THIGH
from geometry.arrays import Array
from geometry.two_links import MIN_FLEXION
from geometry.vectors import (
    Quaternion,
    Vector,
    cross,
    dot,
    minus,
    plus,
    product,
    quaternion_at,
    scaled,
    turned,
    turned_back,
    vector_at,
)

_SATURATION_FLEXION = 0.2  # [rad] flexion below which the correction saturates
_SOFT_COSINE, _HARD_COSINE = float(np.cos(_SATURATION_FLEXION)), float(np.cos(MIN_FLEXION))


@njit
def flexion(c: float) -> tuple[float, float]:
    """Angle f(c) [rad] of a cosine, and f': the arc cosine, levelled off beyond ±cos 0.2; C² for every number."""
    over = (abs(c) - _SOFT_COSINE) / (_HARD_COSINE - _SOFT_COSINE)
    soft, slope = c, 1.0
    if over > 0.0:
        # x / (1 + x³)^(1/3) = x − x⁴/3 + … departs from the identity with a C³ onset.
        root = np.cbrt(1.0 + over**3)
        soft, slope = np.copysign(_SOFT_COSINE + (_HARD_COSINE - _SOFT_COSINE) * over / root, c), root**-4
    return np.arccos(soft), -slope / np.sqrt(1.0 - soft * soft)


class _Flexion(NamedTuple):
    """Turn δ of the middle joint to a required distance D, in A + B cos δ + C sin δ = D², and what its rate needs.

    Attributes
    ----------
    bend : Quaternion
        Turn by δ about the flexion axis.
    first_segment, normal : Vector
        First segment in the frame of the second [m]; axis × second segment [m].
    cosine_factor, sine_factor, amplitude : float
        B, C, √(B² + C²) [m²].
    c : float
        (D² − A)/√(B² + C²).
    wanted_slope, blended_slope : float
        f' at c, and at c₀ of the blended joints.
    """

    bend: Quaternion
    first_segment: Vector
    normal: Vector
    cosine_factor: float
    sine_factor: float
    amplitude: float
    c: float
    wanted_slope: float
    blended_slope: float


@njit
def _solve_flexion(limb: Array, q_middle: Quaternion, square: float) -> _Flexion:
    """The flexion of a limb whose middle joint has the rotation `q_middle`, for a distance with the square D² [m²]."""
    a, b, axis = vector_at(limb, THIGH), vector_at(limb, SHANK), vector_at(limb, AXIS)
    m, normal = turned_back(q_middle, a), cross(axis, b)
    b_axis, m_axis = dot(b, axis), dot(m, axis)
    k_cos, k_sin = 2.0 * (dot(m, b) - m_axis * b_axis), 2.0 * dot(m, normal)
    size = max(np.sqrt(k_cos * k_cos + k_sin * k_sin), 1e-12)
    c = (square - dot(a, a) - dot(b, b) - 2.0 * m_axis * b_axis) / size
    wanted, wanted_slope = flexion(c)
    blended, blended_slope = flexion(k_cos / size)
    half = 0.5 * (wanted - blended)
    sine = np.sin(half)
    bend = np.cos(half), sine * axis[0], sine * axis[1], sine * axis[2]
    return _Flexion(bend, m, normal, k_cos, k_sin, size, c, wanted_slope, blended_slope)


@njit
def _flexion_rate(found: _Flexion, limb: Array, d_square: float, w_middle: Vector) -> float:
    """dδ for a change of D² and of the middle joint's rotation (its angular velocity)."""
    b, axis = vector_at(limb, SHANK), vector_at(limb, AXIS)
    b_axis, size = dot(b, axis), found.amplitude
    d_m = cross(found.first_segment, w_middle)
    d_axis = dot(d_m, axis)
    d_cos, d_sin = 2.0 * (dot(d_m, b) - d_axis * b_axis), 2.0 * dot(d_m, found.normal)
    d_size = (found.cosine_factor * d_cos + found.sine_factor * d_sin) / size
    d_c = (d_square - 2.0 * d_axis * b_axis - found.c * d_size) / size
    d_blended = d_cos - found.cosine_factor / size * d_size
    return found.wanted_slope * d_c - found.blended_slope * d_blended / size


class _Swing(NamedTuple):
    """Shortest rotation from u to a line, as the quaternion (|u| |line| + u·line, u × line) over its norm.

    Attributes
    ----------
    rotation : Quaternion
        The unit quaternion.
    scalar, vector, norm
        The quaternion before it is divided by its norm [m²].
    length, distance : float
        |u|, |line| [m].
    """

    rotation: Quaternion
    scalar: float
    vector: Vector
    norm: float
    length: float
    distance: float


@njit
def _solve_swing(u: Vector, line: Vector) -> _Swing:
    """The shortest rotation from u to the line; not defined if they are half a turn apart."""
    length, distance = max(np.sqrt(dot(u, u)), 1e-9), max(np.sqrt(dot(line, line)), 1e-9)
    scalar, vector = length * distance + dot(u, line), cross(u, line)
    norm = max(np.sqrt(scalar * scalar + dot(vector, vector)), 1e-12)
    rotation = scalar / norm, vector[0] / norm, vector[1] / norm, vector[2] / norm
    return _Swing(rotation, scalar, vector, norm, length, distance)


@njit
def _swing_rate(found: _Swing, u: Vector, line: Vector, d_u: Vector, d_line: Vector) -> Vector:
    """Angular velocity 2 Im(Q⁻¹ ⊗ Q̇) of the rotation Q, in the frame before it, for changes of u and of the line."""
    d_scalar = dot(u, d_u) * found.distance / found.length + dot(line, d_line) * found.length / found.distance
    d_scalar += dot(d_u, line) + dot(u, d_line)
    d_vector = plus(cross(d_u, line), cross(u, d_line))
    across, share = cross(found.vector, d_vector), 2.0 / (found.norm * found.norm)
    return scaled(share, minus(minus(scaled(found.scalar, d_vector), scaled(d_scalar, found.vector)), across))


@njit
def solve_limb(limb: Array, rotations: Array, rates: Array, root: Array, end: Array, tangents: int) -> None:
    """Correct the joints of a limb so that its end has the given pose.

    Parameters
    ----------
    limb : Array, shape (36,)
        `Limb.packed`.
    rotations : Array, shape (joints, 4)
        Root orientation, then joint rotations. On entry the row of the limb's last joint contains the orientation of
        the end; it is replaced by the joint's rotation, and the limb's other joints are corrected.
    rates : Array, shape (joints, 3, k)
        Local angular velocities of the rows of `rotations` with respect to k parameters; updated likewise.
    root, end : Array, shape (1 + k, 3)
        Position of root and end [m], and the derivatives by each parameter.
    tangents : int
        k, or 0 to leave the rates unchanged.
    """
    first, middle, last = int(limb[FIRST]), int(limb[MIDDLE]), int(limb[LAST])
    b, axis, point = vector_at(limb, SHANK), vector_at(limb, AXIS), vector_at(limb, CENTRE)
    q_root, q_end = quaternion_at(rotations, 0), quaternion_at(rotations, last)
    q_first, q_middle = quaternion_at(rotations, first), quaternion_at(rotations, middle)

    # The last joint's position in the frame of the root, from the root's origin and from the first joint.
    from_root = turned_back(q_root, minus(minus(vector_at(end[0], 0), turned(q_end, point)), vector_at(root[0], 0)))
    line = minus(from_root, vector_at(limb, OFFSETS))
    bent = _solve_flexion(limb, q_middle, dot(line, line))
    n_middle = product(q_middle, bent.bend)
    to_last = plus(vector_at(limb, THIGH), turned(n_middle, b))
    u = turned(q_first, to_last)
    swung = _solve_swing(u, line)
    n_first = product(swung.rotation, q_first)
    shank = product(product(q_root, n_first), n_middle)
    n_last = product((shank[0], -shank[1], -shank[2], -shank[3]), q_end)

    for k in range(tangents):
        w_root = rates[0, 0, k], rates[0, 1, k], rates[0, 2, k]
        w_first = rates[first, 0, k], rates[first, 1, k], rates[first, 2, k]
        w_middle = rates[middle, 0, k], rates[middle, 1, k], rates[middle, 2, k]
        w_end = rates[last, 0, k], rates[last, 1, k], rates[last, 2, k]
        v = minus(minus(vector_at(end[1 + k], 0), turned(q_end, cross(w_end, point))), vector_at(root[1 + k], 0))
        d_line = minus(turned_back(q_root, v), cross(w_root, from_root))
        turn = _flexion_rate(bent, limb, 2.0 * dot(line, d_line), w_middle)
        w_middle = plus(turned_back(bent.bend, w_middle), scaled(turn, axis))
        d_u = turned(q_first, plus(cross(w_first, to_last), turned(n_middle, cross(w_middle, b))))
        w_swing = _swing_rate(swung, u, line, d_u, d_line)
        w_first = plus(turned_back(q_first, w_swing), w_first)
        w_shank = plus(turned_back(n_middle, plus(turned_back(n_first, w_root), w_first)), w_middle)
        w_last = minus(w_end, turned_back(n_last, w_shank))
        for i in range(3):
            rates[first, i, k], rates[middle, i, k], rates[last, i, k] = w_first[i], w_middle[i], w_last[i]
    for i in range(4):
        rotations[first, i], rotations[middle, i], rotations[last, i] = n_first[i], n_middle[i], n_last[i]
    limits = limb[LIMITS:LIMB_SIZE].reshape(3, 3, 2)
    for n in range(3):
        joint = int(limb[n])
        saturate_joint(limits[n], end[:, 2], rotations[joint], rates[joint], tangents)
