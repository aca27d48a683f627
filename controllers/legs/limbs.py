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

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.legs.joint_limits import saturate_joint
from controllers.state import Vec3
from geometry.arrays import Array
from geometry.two_links import MIN_FLEXION
from geometry.vectors import (
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

# A packed limb (`Limb.packed`): indices of its three joints, their offsets (3, 3), flexion axis, centre of the end's
# points, limits (3, 3, 2); for a limb that steps, the points of its sole follow (`footsteps`).
FIRST, MIDDLE, LAST, OFFSETS, AXIS, CENTRE, _LIMITS, LIMB_SIZE = 0, 1, 2, 3, 12, 15, 18, 36
THIGH, SHANK = OFFSETS + 3, OFFSETS + 6  # offsets of the middle and the last joint: the limb's two segments
N_END_CHANNELS = 4  # channels that a limb adds to a clip: its end's position (3), λ (`limb_ends`)

_SATURATION_FLEXION = 0.2  # [rad] flexion below which the correction saturates
_NO_LIMIT = 2.0 * np.pi  # [rad] beyond any rotation vector: no limit
# [rad] margin on the range that a clip uses, for poses between its frames: at 120 frames per second a joint that
# accelerates by a = 1000 rad/s² exceeds them by a Δt²/8 = 0.009 rad.
_RANGE_MARGIN = 0.01
_SOFT_COSINE, _HARD_COSINE = float(np.cos(_SATURATION_FLEXION)), float(np.cos(MIN_FLEXION))


@dataclass(frozen=True, eq=False)
class Limb:
    """Kinematic chain of three joints, such as hip, knee and ankle, the first on the root.

    Parameters
    ----------
    joints : tuple of three int
        Indices of the joints: joint k has the numbers 3 + 4k to 6 + 4k of a pose, the root is 0.
    offsets : Array, shape (3, 3)
        Origin of each joint in the segment before it, in the rest pose [m].
    axis : Vec3
        Flexion axis of the middle joint, in the frame of its own segment.
    points : Array, shape (k, 3)
        Points of the last segment that may touch the ground (sole), in its frame [m]; their centre is the end that the
        inverse kinematics places.
    limits : Array, shape (3, 3, 2), optional
        Limits of the components of the joints' rotation vectors (`joint_limits`) [rad]. By default there are none.

    Raises
    ------
    ParameterError
        If numbers are not finite, limits do not increase, or flexion cannot change the limb's length.
    """

    joints: tuple[int, int, int]
    offsets: Array
    axis: Vec3
    points: Array
    limits: Array = field(default_factory=lambda: np.tile([-_NO_LIMIT, _NO_LIMIT], (3, 3, 1)))

    def __post_init__(self) -> None:
        numbers = self.packed()
        if numbers.shape != (LIMB_SIZE,) or not np.isfinite(numbers).all():
            raise ParameterError(
                f"a limb has {LIMB_SIZE} finite numbers (joints 3, offsets 3 × 3, axis 3, centre 3, limits 3 × 3 × 2), "
                f"got {numbers.tolist()}"
            )
        if not (self.limits[..., 0] <= self.limits[..., 1]).all():
            raise ParameterError(f"the limits of a limb's joints must increase, got {self.limits.tolist()}")
        if min(self.joints) < 1 or len(set(self.joints)) != 3:
            raise ParameterError(f"a limb has three joints, counted from 1; got {self.joints}")
        for offset in self.offsets[1:]:
            if np.linalg.norm(np.cross(self.axis, offset)) < 1e-6:
                raise ParameterError(f"flexion about {self.axis} does not move a limb with offsets {self.offsets}")

    def packed(self) -> Array:
        """The limb packed for the kernel: joints, offsets, unit axis, centre of the points, limits; shape (36,)."""
        axis = np.asarray(self.axis, dtype=np.float64)
        unit = axis / max(float(np.linalg.norm(axis)), 1e-300)
        centre, limits = np.mean(self.points, axis=0), np.ravel(self.limits)
        return np.concatenate([self.joints, np.ravel(self.offsets), unit, centre, limits])

    def with_limits_for(self, clips: Sequence[Array]) -> "Limb":
        """The same limb with limits extended to include all poses of clips, each of shape (n, nq).

        Raises
        ------
        ParameterError
            If the poses lack one of its joints.
        """
        joint_count = min(((poses.shape[1] - 7) // 4 for poses in clips), default=max(self.joints))
        if max(self.joints) > joint_count:
            raise ParameterError(f"the poses have {joint_count} joints, a limb needs {self.joints}")
        limits = self.limits.copy()
        for joint, interval in zip(self.joints, limits, strict=True):
            for poses in clips:
                quaternions = poses[:, 3 + 4 * joint : 7 + 4 * joint]
                vectors = Rotation.from_quat(quaternions, scalar_first=True).as_rotvec()
                interval[:, 0] = np.minimum(interval[:, 0], vectors.min(axis=0) - _RANGE_MARGIN)
                interval[:, 1] = np.maximum(interval[:, 1], vectors.max(axis=0) + _RANGE_MARGIN)
        return replace(self, limits=limits)


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


@njit
def _angular_velocity(scalar: float, vector: Vector, norm: float, d_scalar: float, d_vector: Vector) -> Vector:
    """2 Im(Q⁻¹ ⊗ Q̇) of a quaternion Q = (scalar, vector) whose norm need not be one."""
    across, share = cross(vector, d_vector), 2.0 / (norm * norm)
    return scaled(share, minus(minus(scaled(scalar, d_vector), scaled(d_scalar, vector)), across))


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
    first, second, last = int(limb[FIRST]), int(limb[MIDDLE]), int(limb[LAST])
    a, b, axis, point = vector_at(limb, THIGH), vector_at(limb, SHANK), vector_at(limb, AXIS), vector_at(limb, CENTRE)
    q_root, q_end = quaternion_at(rotations, 0), quaternion_at(rotations, last)
    q_first, q_second = quaternion_at(rotations, first), quaternion_at(rotations, second)

    # The last joint's position in the frame of the root, from the root's origin and from the first joint.
    from_root = turned_back(q_root, minus(minus(vector_at(end[0], 0), turned(q_end, point)), vector_at(root[0], 0)))
    line = minus(from_root, vector_at(limb, OFFSETS))
    m, normal = turned_back(q_second, a), cross(axis, b)
    b_axis, m_axis = dot(b, axis), dot(m, axis)
    k_cos, k_sin = 2.0 * (dot(m, b) - m_axis * b_axis), 2.0 * dot(m, normal)
    size = max(np.sqrt(k_cos * k_cos + k_sin * k_sin), 1e-12)
    c = (dot(line, line) - dot(a, a) - dot(b, b) - 2.0 * m_axis * b_axis) / size
    wanted, wanted_slope = flexion(c)
    blended, blended_slope = flexion(k_cos / size)
    half = 0.5 * (wanted - blended)
    sine = np.sin(half)
    bend = np.cos(half), sine * axis[0], sine * axis[1], sine * axis[2]
    n_second = product(q_second, bend)

    to_last = plus(a, turned(n_second, b))
    u = turned(q_first, to_last)
    length, distance = max(np.sqrt(dot(u, u)), 1e-9), max(np.sqrt(dot(line, line)), 1e-9)
    # Half-angle form of the shortest rotation from u to the line; not defined if they are half a turn apart.
    scalar, vector = length * distance + dot(u, line), cross(u, line)
    norm = max(np.sqrt(scalar * scalar + dot(vector, vector)), 1e-12)
    swing = scalar / norm, vector[0] / norm, vector[1] / norm, vector[2] / norm
    n_first = product(swing, q_first)
    shank = product(product(q_root, n_first), n_second)
    n_last = product((shank[0], -shank[1], -shank[2], -shank[3]), q_end)

    for k in range(tangents):
        w_root = rates[0, 0, k], rates[0, 1, k], rates[0, 2, k]
        w_first = rates[first, 0, k], rates[first, 1, k], rates[first, 2, k]
        w_second = rates[second, 0, k], rates[second, 1, k], rates[second, 2, k]
        w_end = rates[last, 0, k], rates[last, 1, k], rates[last, 2, k]
        v = minus(minus(vector_at(end[1 + k], 0), turned(q_end, cross(w_end, point))), vector_at(root[1 + k], 0))
        d_line = minus(turned_back(q_root, v), cross(w_root, from_root))
        d_m = cross(m, w_second)
        d_axis = dot(d_m, axis)
        d_cos, d_sin = 2.0 * (dot(d_m, b) - d_axis * b_axis), 2.0 * dot(d_m, normal)
        d_size = (k_cos * d_cos + k_sin * d_sin) / size
        d_c = (2.0 * dot(line, d_line) - 2.0 * d_axis * b_axis - c * d_size) / size
        turn = wanted_slope * d_c - blended_slope * (d_cos - k_cos / size * d_size) / size
        w_second = plus(turned_back(bend, w_second), scaled(turn, axis))
        d_u = turned(q_first, plus(cross(w_first, to_last), turned(n_second, cross(w_second, b))))
        d_scalar = dot(u, d_u) * distance / length + dot(line, d_line) * length / distance
        d_scalar += dot(d_u, line) + dot(u, d_line)
        d_vector = plus(cross(d_u, line), cross(u, d_line))
        w_swing = _angular_velocity(scalar, vector, norm, d_scalar, d_vector)
        w_first = plus(turned_back(q_first, w_swing), w_first)
        w_shank = plus(turned_back(n_second, plus(turned_back(n_first, w_root), w_first)), w_second)
        w_last = minus(w_end, turned_back(n_last, w_shank))
        for i in range(3):
            rates[first, i, k], rates[second, i, k], rates[last, i, k] = w_first[i], w_second[i], w_last[i]
    for i in range(4):
        rotations[first, i], rotations[second, i], rotations[last, i] = n_first[i], n_second[i], n_last[i]
    limits = limb[_LIMITS:LIMB_SIZE].reshape(3, 3, 2)
    for n in range(3):
        joint = int(limb[n])
        saturate_joint(limits[n], end[:, 2], rotations[joint], rates[joint], tangents)
