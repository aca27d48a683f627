r"""Clips as functions of the hand's angle: splines with a knot at every frame, so that no frame is altered.

Frame k of a clip is at the angle θ_k, which increases with k. Its channels are those of `combination`: the remainder
ρ = exp(−(θ_k/2π) ξ) X_root of the root, the joints, and the ends of limbs. One periodic C² cubic spline of θ goes
through them, stored as values and slopes at its knots (Hermite form: the value at a knot is exactly the stored one).

An open clip leaves a gap in the lap, which a return segment fills, from the last frame to the first of the next lap:
the motion coasts out of the one and into the other, with an eased blend between; rotations take the shorter way. Only
the gap is affected.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from controllers.errors import ParameterError
from controllers.motion.channels import closing_signs, normalise, signed_like
from controllers.motion.loops import drift_of, periodic_remainder, placed_at_origin, plane_exponential, rotate_in_plane
from geometry.arrays import Array
from geometry.easing import smooth_steps
from geometry.quaternions import about_axis, product

LEAST_GAP = 0.05  # [rad] least gap that an open clip must leave in the lap
WIDEST_STEP = 0.5 * np.pi  # [rad] largest angle between two frames

_TURN = 2.0 * np.pi
_COASTING_ANGLE = 0.4  # [rad] of θ over which the motion of an open clip coasts out and in, limited to the gap
_KNOTS, _START, _FIRST_KNOT, _FIRST_ROW, _HEADER = range(5)


@njit
def _hermite(u: float, width: float) -> tuple[float, float, float, float]:
    """Weights of value and slope at the left end of an interval, and at the right, at u in [0, 1]."""
    v = 1.0 - u
    return v * v * (1.0 + 2.0 * u), width * u * v * v, u * u * (3.0 - 2.0 * u), -width * u * u * v


@njit
def interpolate_frames(clips: Array, clip: int, angle: float, value: Array, slope: Array) -> None:
    """Channels of a clip at an angle, and their derivatives by it.

    Parameters
    ----------
    clips : Array
        `packed_frames`.
    clip : int
        Number of the clip.
    angle : float
        θ in [0, 2π].
    value, slope : Array, shape (channels,)
        Written.
    """
    header, channels = clip * _HEADER, value.shape[0]
    pieces, start = int(clips[header + _KNOTS]) - 1, clips[header + _START]
    knots, rows = int(clips[header + _FIRST_KNOT]), int(clips[header + _FIRST_ROW])
    if angle < start:
        angle += _TURN
    low, high = 0, pieces
    while high - low > 1:
        middle = (low + high) // 2
        if clips[knots + middle] <= angle:
            low = middle
        else:
            high = middle
    width = clips[knots + low + 1] - clips[knots + low]
    u = (angle - clips[knots + low]) / width
    v = 1.0 - u
    y0, m0, y1, m1 = _hermite(u, width)
    d, d0, d1 = 6.0 * u * v / width, v * (1.0 - 3.0 * u), u * (3.0 * u - 2.0)
    first = rows + 2 * channels * low
    a, da = clips[first : first + channels], clips[first + channels : first + 2 * channels]
    first += 2 * channels
    b, db = clips[first : first + channels], clips[first + channels : first + 2 * channels]
    for k in range(channels):
        value[k] = y0 * a[k] + m0 * da[k] + y1 * b[k] + m1 * db[k]
        slope[k] = d * (b[k] - a[k]) + d0 * da[k] + d1 * db[k]


def frames_at(spline: tuple[Array, Array, Array], angles: Array) -> Array:
    """Channels (n, channels) of one clip's `lap_spline` at angles θ (n,) in [0, 2π]: `interpolate_frames` in NumPy."""
    knots, values, slopes = spline
    around = np.where(angles < knots[0], angles + _TURN, angles)
    low = np.clip(np.searchsorted(knots, around, "right") - 1, 0, len(knots) - 2)
    width = knots[low + 1] - knots[low]
    weights = cast(Callable[[Array, Array], tuple[Array, ...]], _hermite.py_func)
    y0, m0, y1, m1 = (weight[:, None] for weight in weights((around - knots[low]) / width, width))
    return y0 * values[low] + m0 * slopes[low] + y1 * values[low + 1] + m1 * slopes[low + 1]


def checked_angles(angles: Array, frames: int, closed: bool, name: str) -> Array:
    """Validated angles of a clip's frames [rad]; raises `ParameterError`."""
    array = np.array(angles, dtype=np.float64)
    if array.shape != (frames,):
        raise ParameterError(f"{name} has {frames} frames, its angles have shape {array.shape}; expected ({frames},)")
    if not (np.isfinite(array).all() and (np.diff(array) > 0.0).all()):
        raise ParameterError(f"{name}: the angles of its frames must be finite and increase")
    if np.diff(array).max() > WIDEST_STEP:
        raise ParameterError(
            f"{name}: two of its frames are {np.diff(array).max():.2f} rad apart, and a curve must go round the axis "
            f"between them; expected {WIDEST_STEP:.2f} rad or less: give it a shorter arc, or more frames"
        )
    span = float(array[-1] - array[0])
    if closed:
        if frames < 4:
            raise ParameterError(f"{name}: a closed clip needs 4 frames or more, got {frames}")
        if not 0.0 <= array[0] < _TURN or abs(span - _TURN) > 1e-9:
            raise ParameterError(
                f"{name} is closed: its angles must go once round, from 0 to 2π on, got {array[0]} to {array[-1]} rad"
            )
    elif array[0] < 0.0 or array[-1] > _TURN or span > _TURN - LEAST_GAP:
        raise ParameterError(
            f"{name} is open: its angles must lie within 0 and 2π and leave a gap of {LEAST_GAP} rad or more, got "
            f"{array[0]:.4f} to {array[-1]:.4f} rad"
        )
    return array


def closing_gap(poses: Array) -> float:
    """Largest difference of the last from the first remainder of a clip (n, nq), in a position or quaternion."""
    ends = periodic_remainder(poses, np.linspace(0.0, 1.0, len(poses)), drift_of(poses))[[0, -1]]
    first, last = ends[:, 3:].reshape(2, -1, 4)
    turned_back = np.abs(signed_like(last, first) - first).max()
    return float(max(turned_back, np.abs(ends[1, :3] - ends[0, :3]).max()))


@dataclass(frozen=True, eq=False)
class PlacedClip:
    """A clip at the angles of the hand, moved over the ground so that its remainder is at the origin, facing +x.

    Attributes
    ----------
    poses : Array, shape (n, nq)
        The frames after this displacement.
    angles : Array, shape (n,)
        θ_k [rad].
    closed : bool
        Whether the last frame is the first of the next lap.
    drift : Array, shape (3,)
        ξ of a lap.
    """

    poses: Array
    angles: Array
    closed: bool
    drift: Array

    @staticmethod
    def of(poses: Array, angles: Array, closed: bool) -> "PlacedClip":
        """Clip from poses that passed `checked_clip` and angles that passed `checked_angles`."""
        placed, drift = placed_at_origin(poses, (angles - angles[0]) / _TURN)
        # At the angle θ₀ the drift has already moved the figure by the share θ₀/2π of a lap.
        shift, heading = plane_exponential(angles[0] / _TURN * drift)
        placed[:, :2] = rotate_in_plane(heading, placed[:, :2]) + shift
        placed[:, 3:7] = product(about_axis(2, heading), placed[:, 3:7])
        return PlacedClip(placed, angles, closed, drift)

    @property
    def remainder(self) -> Array:
        """ρ and the joints at the frames, shape (n, nq)."""
        return periodic_remainder(self.poses, self.angles / _TURN, self.drift)


def lap_spline(angles: Array, channels: Array, rotations: int, closed: bool) -> tuple[Array, Array, Array]:
    """Periodic C² spline through the frames of a clip, with a return segment over the gap of an open one.

    Parameters
    ----------
    angles : Array, shape (n,)
        θ_k [rad].
    channels : Array, shape (n, channels)
        Position, unit quaternions, then any periodic channels.
    rotations : int
        Number of quaternions.
    closed : bool

    Returns
    -------
    knots : Array, shape (k + 1,)
        Angles of a lap, with the first one plus 2π at the end.
    values, slopes : Array, shape (k + 1, channels)
    """
    signs = closing_signs(channels, rotations)
    if closed:
        knots, values = angles[:-1], channels[:-1]
    else:
        between, back = _return_segment(angles, channels, rotations, signs)
        knots, values = np.concatenate([angles, between]), np.concatenate([channels, back])
    n = len(knots)
    # A quaternion that returns with the opposite sign is periodic over two laps.
    twice = np.concatenate([values, signs * values, values[:1]])
    spline = CubicSpline(np.concatenate([knots, knots + _TURN, [knots[0] + 2.0 * _TURN]]), twice, bc_type="periodic")
    slopes = spline(spline.x[: n + 1], 1)
    return spline.x[: n + 1], twice[: n + 1], slopes


def _return_segment(angles: Array, channels: Array, rotations: int, signs: Array) -> tuple[Array, Array]:
    """Angles and channels between the last frame of an open clip and the first of the next lap."""
    gap = angles[0] + _TURN - angles[-1]
    count = max(3, round(gap / 0.1))
    u = np.arange(1, count) / count
    coast = min(_COASTING_ANGLE, gap)
    # One-sided slopes, damped to zero over the coast.
    out = (channels[-1] - channels[-2]) / (angles[-1] - angles[-2])
    back = signs * (channels[1] - channels[0]) / (angles[1] - angles[0])
    rest_out, rest_back = (np.maximum(1.0 - gap * s / coast, 0.0) ** 3 * gap * s for s in (u, 1.0 - u))
    leaving = channels[-1] + rest_out[:, None] * out
    arriving = signs * channels[0] - rest_back[:, None] * back
    ease = smooth_steps(u)[:, None]
    values = (1.0 - ease) * leaving + ease * arriving
    normalise(values, rotations)
    return angles[-1] + gap * u, values


def packed_frames(splines: list[tuple[Array, Array, Array]]) -> Array:
    """Knots, values and slopes of each clip (`lap_spline`), packed for `interpolate_frames`."""
    headers: list[float] = []
    blocks: list[Array] = []
    at = _HEADER * len(splines)
    for knots, values, slopes in splines:
        headers += [len(knots), knots[0], at, at + len(knots)]
        blocks += [knots, np.stack([values, slopes], axis=1).ravel()]
        at += len(knots) + 2 * values.size
    return np.concatenate([headers, *blocks])
