r"""A small change of a motion, q(t) = q_ref(t) exp δ(t) with a quintic B-spline δ in the tangent, and normal equations.

The spline of a closed motion is periodic up to the lap's yaw (matrix W). An open motion rests at both ends, and so does
its change: the outer five control points are equal, so that δ̇ = δ̈ = 0 there. A passage is part of a longer motion that
is unchanged beyond its ends: the outer five control points are zero, so that δ = 0 as well. Each instant depends on six
control points, so the normal equations are banded; those of a closed motion have a border for the last five points.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import as_strided
from scipy.interpolate import BSpline, CubicSpline
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded, solve_triangular
from scipy.linalg.blas import dsbmv  # pyright: ignore[reportAttributeAccessIssue]

from geometry.arrays import Array
from models.humanoid.skeleton import N_TANGENT
from models.mocap.motion.clip import Clip, pose_difference
from models.mocap.preparation.poses import add_tangents, extend_periodically

DEGREE = 5
# Spacing of knots and of sampled instants [s]. With 80 and 20 ms preparation takes half the time, but the figure falls
# in a run.
_KNOT_SPACING, _INSTANT_SPACING = 0.05, 0.0125
# Step of the finite differences for velocities and accelerations [s]. Half or twice the step changes accelerations of
# up to 250 rad/s², in a kick with rough changes, by 1.7 or 4.2 rad/s². Either changes SNU's prepared run by 0.03° RMS.
# Half changes its prepared walk by 0.6° (residual of 2.8 % of body weight instead of 2.6 %), twice by 0.02°.
_DIFFERENCE_STEP = 1e-3
_TIED_COUNT = DEGREE - 1  # control points at either end of an open motion that equal the first or last free one
# Frames beyond a closed clip's ends: their influence on its spline decays by 0.27 a frame, to 1e-7.
_PERIODIC_MARGIN = 12


@dataclass(frozen=True, eq=False)
class State:
    """States of the changed motion at m sampled instants: qpos (m, 75), qvel (m, 57) and qacc (m, 57)."""

    q: Array
    v: Array
    a: Array


class Change:
    """The change δ(t) of a clip: n_points free control points of 57 numbers.

    Parameters
    ----------
    clip : Clip
        q_ref; closed, or open.
    knot, step : float
        Approximate spacing of knots and of sampled instants [s]; both are adjusted to divide the clip.
    passage : bool
        Whether an open clip is a part of a longer motion that is unchanged beyond its ends.

    Attributes
    ----------
    times : array, shape (m,)
        Sampled instants [s].
    passage : bool
        As given.
    outer : int
        Number of control points at either end of an open clip that are not unknowns.
    basis : list of 4 arrays, shape (m, 6)
        Weights of the six control points on which an instant depends, and their first three derivatives.
    first : array of int, shape (m,)
        Index of the first of these six control points.
    """

    def __init__(
        self, clip: Clip, knot: float = _KNOT_SPACING, step: float = _INSTANT_SPACING, passage: bool = False
    ) -> None:
        self.clip, self.closed = clip, clip.closes() and not passage
        self.passage, self._ends_at_rest = passage, not self.closed and not passage
        self.outer = 0 if self.closed else _TIED_COUNT + int(passage)
        seconds = clip.duration
        self.intervals = max(2 * DEGREE, round(seconds / knot))
        per_interval = max(2, round(seconds / self.intervals / step))
        count = self.intervals * per_interval
        self.times = np.arange(count + (not self.closed)) * seconds / count
        self.n_points = self.intervals if self.closed else self.intervals + DEGREE - 2 * self.outer
        spacing = seconds / self.intervals
        knots = (np.arange(self.intervals + 2 * DEGREE + 1) - DEGREE) * spacing
        self._spline = BSpline(knots, np.eye(self.intervals + DEGREE), DEGREE)
        self.first = np.minimum((self.times / spacing + 1e-9).astype(int), self.intervals - 1)
        times = np.minimum(self.times, seconds - 1e-12)
        indices = self.first[:, None] + np.arange(DEGREE + 1)
        self.basis = [np.take_along_axis(self._spline(times, order), indices, axis=1) for order in range(4)]
        self.wrap = np.eye(N_TANGENT)
        displacement = clip.displacement
        if self.closed:
            c, s = np.cos(displacement.yaw), np.sin(displacement.yaw)
            self.wrap[:2, :2] = [[c, -s], [s, c]]
            poses, first = extend_periodically(clip, _PERIODIC_MARGIN)
            self._reference = CubicSpline((np.arange(len(poses)) - first) / clip.fps, poses)
        else:
            ends = "clamped" if self._ends_at_rest else "not-a-knot"
            self._reference = CubicSpline(np.arange(clip.n_frames) / clip.fps, clip.poses, bc_type=ends)
        self._end = seconds
        self.border = DEGREE * N_TANGENT if self.closed else 0

    def _reference_at(self, times: Array) -> Array:
        poses = self._reference(np.clip(times, 0.0, self._end) if self._ends_at_rest else times)
        rotations = poses[:, 3:].reshape(len(poses), -1, 4)
        poses[:, 3:] = (rotations / np.linalg.norm(rotations, axis=2, keepdims=True)).reshape(len(poses), -1)
        return poses

    def points(self, x: Array) -> Array:
        """All control points, including those that wrap around or are not free, shape (intervals + 5, 57)."""
        if not self.closed:
            return np.pad(x, ((self.outer, self.outer), (0, 0)), mode="edge" if self._ends_at_rest else "constant")
        return np.vstack((x, x[:DEGREE] @ self.wrap.T))

    def free(self, interval: int) -> tuple[int, Array]:
        """The control points of a knot interval of an open motion as linear combinations of free ones.

        Returns the index of the first of six consecutive free points, and their coefficients (6, 6).
        """
        points = np.arange(interval, interval + DEGREE + 1) - self.outer
        inside = np.clip(points, 0, self.n_points - 1)
        first = min(int(inside[0]), self.n_points - DEGREE - 1)
        coefficients = np.eye(DEGREE + 1)[inside - first]
        coefficients[(inside != points) & self.passage] = 0.0
        return first, coefficients

    def states(self, x: Array, instants: npt.NDArray[np.intp] | slice = slice(None)) -> State:
        """States of the changed motion at the sampled instants, or at a subset of them."""
        points, times = self.points(x), self.times[instants]
        indices = self.first[instants, None] + np.arange(DEGREE + 1)
        d, dd, ddd = (np.einsum("mk,mkn->mn", self.basis[order][instants], points[indices]) for order in range(3))
        moments = [
            add_tangents(
                self._reference_at(times + o * _DIFFERENCE_STEP),
                d + o * _DIFFERENCE_STEP * dd + 0.5 * _DIFFERENCE_STEP**2 * o * o * ddd,
            )
            for o in (-1.0, 0.0, 1.0)
        ]
        before, now, after = moments
        v = pose_difference(before, after) / (2 * _DIFFERENCE_STEP)
        a = (pose_difference(now, after) - pose_difference(before, now)) / _DIFFERENCE_STEP**2
        a[:, :3] = (after[:, :3] - 2 * now[:, :3] + before[:, :3]) / _DIFFERENCE_STEP**2
        if self._ends_at_rest:
            at_rest = (times <= 0.0) | (times >= self._end - 1e-9)
            v[at_rest] = a[at_rest] = 0.0
        return State(now, v, a)

    def changed(self, x: Array, fps: float) -> Clip:
        """The changed clip at a frame rate [1/s]; closed if the clip was."""
        n = round(self.clip.duration * fps)
        times = np.arange(n + 1) * self._end / n
        tangents = self._spline(np.minimum(times, self._end - 1e-12)) @ self.points(x)
        poses = add_tangents(self._reference_at(times), tangents)
        if self.closed:
            poses[-1] = self.clip.displacement.moved(poses[0])
        return Clip(poses, n / self._end, self.clip.name)

    def size(self, x: Array) -> Array:
        """The change δ at the sampled instants, shape (m, 57)."""
        indices = self.first[:, None] + np.arange(DEGREE + 1)
        return np.einsum("mk,mkn->mn", self.basis[0], self.points(x)[indices])


class NormalEquations:
    """Normal equations H x = g for the control points of a change: a band, and a border where the motion is closed.

    Parameters
    ----------
    change : Change
        The change whose control points are the unknowns.
    """

    def __init__(self, change: Change) -> None:
        n = N_TANGENT
        self._change = change
        self._inner = change.n_points * n - change.border
        self._width = (DEGREE + 1) * n
        self.band = np.zeros((self._width, self._inner), order="F")
        self.side = np.zeros((self._inner, change.border))
        self.corner = np.zeros((change.border, change.border))

    def copy(self) -> "NormalEquations":
        """A copy to which more blocks can be added."""
        result = NormalEquations(self._change)
        result.band, result.side, result.corner = self.band.copy(order="K"), self.side.copy(), self.corner.copy()
        return result

    def add(self, interval: int, block: Array) -> None:
        """Add a block (342, 342) that couples the six control points of a knot interval."""
        n, change = N_TANGENT, self._change
        if not change.closed:
            interval, factors = change.free(interval)
            if not np.array_equal(factors, np.eye(DEGREE + 1)):
                parts = block.reshape(DEGREE + 1, n, DEGREE + 1, n)
                block = np.einsum("ia,imjn,jb->ambn", factors, parts, factors, optimize=True).reshape(block.shape)
        if not change.closed or interval + DEGREE < change.n_points - DEGREE:
            for column in range(self._width):
                self.band[: self._width - column, interval * n + column] += block[column, column:]
            return
        points = np.arange(interval, interval + DEGREE + 1)
        wrapped = np.flatnonzero(points >= change.n_points)
        block = block.copy()
        for k in wrapped:
            block[:, k * n : (k + 1) * n] = block[:, k * n : (k + 1) * n] @ change.wrap
        for k in wrapped:
            block[k * n : (k + 1) * n] = change.wrap.T @ block[k * n : (k + 1) * n]
        points = points % change.n_points
        edge = change.n_points - DEGREE
        for i, a in enumerate(points):
            for j, b in enumerate(points):
                part = block[i * n : (i + 1) * n, j * n : (j + 1) * n]
                if a >= edge and b >= edge:
                    self.corner[(a - edge) * n : (a - edge + 1) * n, (b - edge) * n : (b - edge + 1) * n] += part
                elif b >= edge:
                    self.side[a * n : (a + 1) * n, (b - edge) * n : (b - edge + 1) * n] += part
                elif a < edge and a >= b:
                    rows, columns = np.indices((n, n))
                    keep = (a - b) * n + rows - columns >= 0
                    self.band[((a - b) * n + rows - columns)[keep], (b * n + columns)[keep]] += part[keep]

    def gradient(self, parts: Array) -> Array:
        """Sum of gradients (intervals, 342) by knot interval, as one vector."""
        n, change = N_TANGENT, self._change
        total = np.zeros((change.intervals + DEGREE, n))
        for interval, part in enumerate(parts):
            total[interval : interval + DEGREE + 1] += part.reshape(-1, n)
        if change.closed:
            total[:DEGREE] += total[change.intervals :] @ change.wrap
            total = total[: change.intervals]
        else:
            outer = change.outer
            if not change.passage:
                total[outer] += total[:outer].sum(axis=0)
                total[-outer - 1] += total[-outer:].sum(axis=0)
            total = total[outer:-outer]
        return total.ravel()

    def times(self, x: Array) -> Array:
        """H x."""
        inner, border = x[: self._inner], x[self._inner :]
        y = dsbmv(self._width - 1, 1.0, self.band, inner, lower=1)
        return np.concatenate((y + self.side @ border, self.side.T @ inner + self.corner @ border))

    def solve(self, g: Array, damping: float) -> Array:
        """Solution x of (H + damping diag H) x = g."""
        band = self.band.copy(order="K")
        band[0] = band[0] * (1.0 + damping) + 1e-9
        factor = cholesky_banded(band, lower=True, check_finite=False)
        inner, border = g[: self._inner], g[self._inner :]
        if not len(border):
            return cho_solve_banded((factor, True), inner, check_finite=False)
        first = cho_solve_banded((factor, True), inner, check_finite=False)
        solved_side = self._solve_side(factor)
        corner = self.corner + np.diag(damping * np.diag(self.corner) + 1e-9) - solved_side.T @ solved_side
        last = cho_solve(cho_factor(corner), border - self.side.T @ first)
        return np.concatenate((cho_solve_banded((factor, True), inner - self.side @ last, check_finite=False), last))

    def _solve_side(self, factor: Array) -> Array:
        """L⁻¹ times `side`, in blocks as wide as the band: three times as fast as LAPACK column by column.

        As columns are stored from the diagonal on, L_ij is at i + j (width − 1) in memory where it is within the band.
        """
        width, solved = self._width, self.side.copy()
        entries, above_diagonal = factor.ravel(order="F"), np.triu(np.ones((width, width)), 1)
        strides = (entries.itemsize, entries.itemsize * (width - 1))
        for start in range(0, self._inner, width):
            rows = slice(start, min(start + width, self._inner))
            n = rows.stop - start
            if start:
                previous = slice(start - width, start)
                beside = as_strided(entries[previous.start * width + width :], (n, width), strides, writeable=False)
                solved[rows] -= (beside * above_diagonal[:n]) @ solved[previous]
            diagonal = as_strided(entries[start * width :], (n, n), strides, writeable=False)
            solved[rows] = solve_triangular(diagonal, solved[rows], lower=True, check_finite=False)
        return solved
