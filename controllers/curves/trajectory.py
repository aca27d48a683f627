"""Curves φ: I → SE(3) or S¹ → SE(3): C² cubic splines through samples, and their packed form for compiled laws."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, cast

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import check_field_types, check_kind, checked, numbers_of
from controllers.curves.bounds import capsule_tree
from controllers.errors import CurveError
from geometry.arrays import Array
from geometry.quaternions import with_continuous_signs

# The packed curve: a header, then three blocks; every offset counts from the start of the header.
SIZE, PIECES, PERIODIC, START, END, LEVELS, BREAKS, COEFFICIENTS, TREE, HEADER = range(10)
CHANNELS = 7  # position (3) and quaternion (4), the quaternion not yet of unit length
PIECE = 4 * CHANNELS  # numbers per piece: rows 1, u, u², u³ with u = t − break

# Gauss-Legendre on [0, 1]: arc length of a piece, the integral of |φ̇|.
_nodes, _weights = np.polynomial.legendre.leggauss(6)
_GAUSS_NODES: Array = 0.5 * (_nodes + 1.0)
_GAUSS_WEIGHTS: Array = 0.5 * _weights
_CIRCLE_PIECES = 96  # of a circle, which keep the spline within 1e-6 of the radius


@njit
def wrap_phase(blob: Array, at: int, t: float) -> float:
    """Phase in [start, end] for any t: wrapped if the curve at ``blob[at:]`` is periodic, else clamped."""
    start, end = blob[at + START], blob[at + END]
    if blob[at + PERIODIC] > 0.0:
        period = end - start
        t = t - period * np.floor((t - start) / period)
    return min(max(t, start), end)


@njit
def find_piece(blob: Array, at: int, t: float) -> int:
    """Index of the piece that contains the phase t of [start, end]: directly for equal steps, else by bisection."""
    breaks = at + int(blob[at + BREAKS])
    low, high = 0, int(blob[at + PIECES])
    share = (t - blob[at + START]) / (blob[at + END] - blob[at + START])
    # The bounds also protect against the integer that int() gives for NaN.
    likely = max(0, min(int(share * high), high - 1))
    if blob[breaks + likely] <= t < blob[breaks + likely + 1]:
        return likely
    while high - low > 1:
        middle = (low + high) // 2
        if blob[breaks + middle] <= t:
            low = middle
        else:
            high = middle
    return low


@njit
def piece_point(blob: Array, row: int, u: float) -> tuple[float, float, float]:
    """φ of the piece whose coefficients start at ``blob[row]``, u seconds after its break."""
    x = blob[row] + u * (blob[row + 7] + u * (blob[row + 14] + u * blob[row + 21]))
    y = blob[row + 1] + u * (blob[row + 8] + u * (blob[row + 15] + u * blob[row + 22]))
    z = blob[row + 2] + u * (blob[row + 9] + u * (blob[row + 16] + u * blob[row + 23]))
    return x, y, z


@njit
def piece_velocity(blob: Array, row: int, u: float) -> tuple[float, float, float]:
    """φ̇ of the piece whose coefficients start at ``blob[row]``, u seconds after its break."""
    x = blob[row + 7] + u * (2.0 * blob[row + 14] + 3.0 * u * blob[row + 21])
    y = blob[row + 8] + u * (2.0 * blob[row + 15] + 3.0 * u * blob[row + 22])
    z = blob[row + 9] + u * (2.0 * blob[row + 16] + 3.0 * u * blob[row + 23])
    return x, y, z


@njit
def piece_acceleration(blob: Array, row: int, u: float) -> tuple[float, float, float]:
    """φ̈ of the piece whose coefficients start at ``blob[row]``, u seconds after its break."""
    x = 2.0 * blob[row + 14] + 6.0 * u * blob[row + 21]
    y = 2.0 * blob[row + 15] + 6.0 * u * blob[row + 22]
    z = 2.0 * blob[row + 16] + 6.0 * u * blob[row + 23]
    return x, y, z


@njit
def _locate_phase(blob: Array, at: int, t: float) -> tuple[int, float]:
    """Offset of the coefficients of the piece at t, and the time since its break [s]."""
    t = wrap_phase(blob, at, t)
    piece = find_piece(blob, at, t)
    return at + int(blob[at + COEFFICIENTS]) + piece * PIECE, t - blob[at + int(blob[at + BREAKS]) + piece]


@njit
def curve_point(blob: Array, at: int, t: float) -> tuple[float, float, float]:
    """φ(t) [m] of the curve packed at ``blob[at:]``."""
    row, u = _locate_phase(blob, at, t)
    return piece_point(blob, row, u)


@njit
def curve_velocity(blob: Array, at: int, t: float) -> tuple[float, float, float]:
    """φ̇(t) [m/s] of the curve packed at ``blob[at:]``."""
    row, u = _locate_phase(blob, at, t)
    return piece_velocity(blob, row, u)


@njit
def curve_acceleration(blob: Array, at: int, t: float) -> tuple[float, float, float]:
    """φ̈(t) [m/s²] of the curve packed at ``blob[at:]``."""
    row, u = _locate_phase(blob, at, t)
    return piece_acceleration(blob, row, u)


def _checked_samples(name: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> Array:
    array = numbers_of(f"{name} of a curve", values)
    if array.shape != shape:
        raise CurveError(f"{name} of a curve must have shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        bad = int(np.argwhere(~np.isfinite(array))[0][0])
        raise CurveError(f"{name} of a curve must be finite; sample {bad} is not")
    array.flags.writeable = False
    return array


def _checked_signs(quaternions: Array) -> Array:
    """Flip signs so that neighbours agree; raises if samples are too far apart to tell the direction of turning."""
    dots = np.einsum("ij,ij->i", quaternions[:-1], quaternions[1:])
    if dots.size and np.abs(dots).min() < 0.5:
        at = int(np.abs(dots).argmin())
        angle = np.degrees(2.0 * np.arccos(np.abs(dots[at])))
        raise CurveError(f"orientation turns {angle:.0f}° from sample {at} to {at + 1}; sample it every 120° or less")
    return with_continuous_signs(quaternions)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    r"""Curve in the space of stylus poses, open or periodic.

    .. math:: \varphi(t) = \bigl(p(t),\; s(t)/|s(t)|\bigr)

    with C² cubic splines p through the positions and s through the quaternions (in R⁴, signs made continuous): the
    orientation meets its samples exactly and is C² as well.

    Parameters
    ----------
    times : array_like, shape (n,)
        Strictly increasing phases of the samples [s].
    positions : array_like, shape (n, 3)
        Positions in the hand frame H [m]. A periodic curve repeats its first sample as its last.
    quaternions : array_like, shape (n, 4), optional
        R_H, unit, wxyz; neighbours less than 120° apart. By default the stylus stays upright.
    periodic : bool
        Whether φ closes (C²) and repeats.
    ends : {"natural", "clamped"}
        Ends of an open curve: without curvature, or at rest.

    Raises
    ------
    CurveError
        If there are too few samples, they are not finite, times do not increase, the curve has no length, or a
        periodic curve does not close.
    """

    times: npt.ArrayLike
    positions: npt.ArrayLike
    quaternions: npt.ArrayLike | None = None
    periodic: bool = False
    ends: Literal["natural", "clamped"] = "natural"

    def __repr__(self) -> str:
        points = np.asarray(self.positions, dtype=np.float64)
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        kind = "closed" if self.periodic else "open"
        return f"<{kind} curve of {len(points)} samples, {length:.3g} m in {self.duration:.3g} s>"

    def __post_init__(self) -> None:
        check_field_types(self)
        n = numbers_of("times of a curve", self.times).size
        least = 4 if self.periodic else 2
        if n < least:
            kind = "periodic" if self.periodic else "open"
            raise CurveError(f"a curve of kind {kind} needs at least {least} samples, got {n}")
        times = _checked_samples("times", self.times, (n,))
        positions = _checked_samples("positions", self.positions, (n, 3))
        if not (np.diff(times) > 0.0).all():
            at = int(np.argmin(np.diff(times)))
            raise CurveError(f"times of a curve must increase; samples {at}, {at + 1} are at {times[at : at + 2]} s")
        length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
        if length < 1e-6:
            raise CurveError(f"a curve needs a length of at least 1e-6 m, this one has {length:.3g} m")
        if self.periodic and np.linalg.norm(positions[-1] - positions[0]) > 1e-9:
            gap = np.linalg.norm(positions[-1] - positions[0])
            raise CurveError(f"a periodic curve must repeat its first sample as its last; the gap is {gap:.3g} m")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "quaternions", self._checked_quaternions(n))

    def _checked_quaternions(self, n: int) -> Array:
        if self.quaternions is None:
            return np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        quaternions = _checked_samples("quaternions", self.quaternions, (n, 4))
        norms = np.linalg.norm(quaternions, axis=1)
        if np.abs(norms - 1.0).max() > 1e-6:
            worst = norms[np.abs(norms - 1.0).argmax()]
            raise CurveError(f"quaternions of a curve must have unit length, one has {worst:.6g}")
        quaternions = _checked_signs(quaternions / norms[:, None])
        if self.periodic and 1.0 - abs(float(quaternions[-1] @ quaternions[0])) > 1e-9:
            raise CurveError("a periodic curve must repeat its first orientation as its last")
        return quaternions

    @staticmethod
    def circle(
        radius: float, period: float, centre: npt.ArrayLike = (0.0, 0.0, 0.0), wave: float = 0.0
    ) -> "Trajectory":
        """Circle about an axis parallel to z of H, counter-clockwise from +x, once in `period` seconds.

        With a wave it also goes up and down, z = a sin 3θ, so that every joint of a Phantom turns both ways.

        Parameters
        ----------
        radius : float
            [m].
        period : float
            [s].
        centre : array_like, shape (3,)
            In H [m].
        wave : float
            a [m].

        Raises
        ------
        ControllerError
            If an argument is not a number, negative or not finite, or the circle has no length.
        """
        checked("radius", radius, "m")
        checked("period", period, "s")
        check_kind("wave", wave, float)
        middle = numbers_of("centre", centre)
        if middle.shape != (3,):
            raise CurveError(f"the centre of a circle is {middle.tolist()}; expected three numbers")
        angle = np.linspace(0.0, 2.0 * np.pi, _CIRCLE_PIECES + 1)
        ring = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        ring[:, 2] = wave * np.sin(3.0 * angle)
        ring[-1] = ring[0]
        return Trajectory(period * angle / (2.0 * np.pi), middle + ring, periodic=True)

    @cached_property
    def coefficients(self) -> Array:
        """Powers of u = t − break, shape (pieces, 4, 7): rows 1, u, u², u³; columns position and quaternion."""
        # Imported here, since SciPy's splines take a quarter of a second to import and not every curve needs them.
        from scipy.interpolate import CubicSpline

        times, positions, quaternions = (cast("Array", a) for a in (self.times, self.positions, self.quaternions))
        if self.periodic:
            position = CubicSpline(times, np.vstack([positions[:-1], positions[:1]]), bc_type="periodic").c
            # An orientation that returns as −q has turned once; over two laps it is periodic in R⁴ too.
            sign = float(np.sign(quaternions[-1] @ quaternions[0]))
            twice = np.vstack([quaternions[:-1], sign * quaternions[:-1], quaternions[:1]])
            knots = np.concatenate([times[:-1], times + times[-1] - times[0]])
            orientation = CubicSpline(knots, twice, bc_type="periodic").c[:, : len(times) - 1]
        else:
            position = CubicSpline(times, positions, bc_type=self.ends).c
            orientation = CubicSpline(times, quaternions, bc_type=self.ends).c
        return np.ascontiguousarray(np.concatenate([position, orientation], axis=2)[::-1].transpose(1, 0, 2))

    @property
    def start(self) -> float:
        """Phase of the first sample [s]."""
        return float(cast("Array", self.times)[0])

    @property
    def end(self) -> float:
        """Phase of the last sample [s]; for a periodic curve, of the repeated first sample, one period later."""
        return float(cast("Array", self.times)[-1])

    @property
    def duration(self) -> float:
        """Duration of one lap, or from end to end [s]."""
        return self.end - self.start

    def _evaluate(self, t: npt.ArrayLike, derivative: int) -> Array:
        times, phase = cast("Array", self.times), np.asarray(t, dtype=float)
        if self.periodic:
            phase = self.start + np.mod(phase - self.start, self.duration)
        phase = np.clip(phase, self.start, self.end)
        piece = np.clip(np.searchsorted(times, phase, side="right") - 1, 0, len(times) - 2)
        u, value = (phase - times[piece])[..., None], np.zeros((*phase.shape, CHANNELS))
        for power in range(3, derivative - 1, -1):
            factor = float(np.prod(np.arange(power - derivative + 1, power + 1)))
            value = value * u + factor * self.coefficients[piece, power]
        return value

    def point(self, t: npt.ArrayLike) -> Array:
        """φ(t) [m], shape (..., 3) for phases of shape (...)."""
        return self._evaluate(t, 0)[..., :3]

    def velocity(self, t: npt.ArrayLike) -> Array:
        """φ̇(t) [m/s], shape (..., 3)."""
        return self._evaluate(t, 1)[..., :3]

    def acceleration(self, t: npt.ArrayLike) -> Array:
        """φ̈(t) [m/s²], shape (..., 3)."""
        return self._evaluate(t, 2)[..., :3]

    def orientation(self, t: npt.ArrayLike) -> Array:
        """R_H(t), unit quaternions wxyz, shape (..., 4)."""
        s = self._evaluate(t, 0)[..., 3:]
        return s / np.linalg.norm(s, axis=-1, keepdims=True)

    def curvature(self, t: npt.ArrayLike) -> Array:
        """κ = |φ̇ × φ̈| / |φ̇|³ [1/m], shape (...); infinite where the curve stands still."""
        velocity, speed = self.velocity(t), np.linalg.norm(self.velocity(t), axis=-1)
        bend = np.linalg.norm(np.cross(velocity, self.acceleration(t)), axis=-1)
        return np.divide(bend, speed**3, out=np.full_like(speed, np.inf), where=speed > 1e-12)

    def arc_length(self, t: npt.ArrayLike) -> Array:
        """Length [m] of the curve from its start to φ(t), t in [start, end], shape (...) for phases of shape (...)."""
        times, phase = cast("Array", self.times), np.clip(np.asarray(t, dtype=float), self.start, self.end)
        piece = np.clip(np.searchsorted(times, phase, side="right") - 1, 0, len(times) - 2)
        cumulative = np.concatenate(([0.0], np.cumsum(self._arc_within_piece(times[:-1], np.diff(times)))))
        return cumulative[piece] + self._arc_within_piece(times[piece], phase - times[piece])

    def _arc_within_piece(self, t: Array, step: Array) -> Array:
        """Integral of |φ̇| over [t, t + step] within a piece, by Gauss-Legendre quadrature."""
        speed = np.linalg.norm(self.velocity(t[..., None] + step[..., None] * _GAUSS_NODES), axis=-1)
        return step * (speed @ _GAUSS_WEIGHTS)

    @cached_property
    def length(self) -> float:
        """Arc length of the whole curve [m]."""
        return float(self.arc_length(self.end))

    @cached_property
    def reach(self) -> float:
        r"""Radius [m] up to which the closest point is unique: an estimate from samples, not a bound.

        The least of the radii of curvature and of |q − p|² / (2 dist(q − p, T_p)) over pairs (Federer 1959, theorem
        4.18), taken on 1024 samples equally spaced in phase; it tends to the reach from above as they get denser.
        """
        t = np.linspace(self.start, self.end, 1024, endpoint=not self.periodic)
        points, velocity = self.point(t), self.velocity(t)
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        tangent = np.divide(velocity, speed, out=np.zeros_like(velocity), where=speed > 1e-12)
        best = float(1.0 / np.maximum(self.curvature(t), 1e-12).max())
        for i in range(len(t)):
            chord = points - points[i]
            square = np.einsum("ij,ij->i", chord, chord)
            off = np.sqrt(np.maximum(square - (chord @ tangent[i]) ** 2, 0.0))
            # Pairs closer than a few samples only measure the curvature again, with rounding errors.
            near = np.abs(np.arange(len(t)) - i)
            far = (np.minimum(near, len(t) - near) if self.periodic else near) > 4
            radius = np.divide(square, 2.0 * off, out=np.full_like(off, np.inf), where=far & (off > 1e-12))
            best = min(best, float(radius.min()))
        return best

    def packed(self) -> Array:
        """The curve as one array for the kernels: header, breaks, coefficients, tree of bounds."""
        coefficients, times = self.coefficients, cast("Array", self.times)
        tree, levels = capsule_tree(coefficients[:, :, :3], np.diff(times))
        blocks = [times, coefficients.ravel(), tree.ravel()]
        offsets = np.cumsum([HEADER] + [len(block) for block in blocks])
        header = np.zeros(HEADER)
        header[[BREAKS, COEFFICIENTS, TREE, SIZE]] = offsets
        header[[PIECES, PERIODIC, LEVELS]] = len(coefficients), float(self.periodic), levels
        header[[START, END]] = self.start, self.end
        return np.concatenate([header, *blocks])
