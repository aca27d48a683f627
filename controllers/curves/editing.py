"""Conversion between curves and the editing record of `controllers.curves.deformation`.

The kernels there grasp, bend, commit, undo and redo.
"""

import numpy as np

from controllers.curves.deformation import DEPTH, EDIT, HALF, RECORD_HEADER, STEP, TABLE, work_curve
from controllers.curves.trajectory import BREAKS, CHANNELS, COEFFICIENTS, PIECE, PIECES, Trajectory
from controllers.errors import CurveError
from geometry.arrays import Array

_STEPS_PER_HALF_WIDTH = 16  # grid steps per half width h: the centre of a bump is at most h/32 from the grasped phase
_MAX_DURATION_RATIO = 10_000  # largest duration of a curve in half widths: 160 000 steps, a hundred megabytes
MAX_EDITS = 10_000  # largest number of edits that can be undone; each is stored as five numbers
_BREAK_TOLERANCE = 1e-9  # fraction of a grid step: breaks nearer than this coincide


def _curve_of_pieces(times: Array, coefficients: Array, like: Trajectory) -> Trajectory:
    """Curve with exactly these coefficients, instead of a new spline through its samples."""
    u = (times[-1] - times[-2]) ** np.arange(4)
    samples = np.vstack([coefficients[:, 0], u @ coefficients[-1]])
    if like.periodic:
        samples[-1, :3] = samples[0, :3]
    quaternions = samples[:, 3:] / np.linalg.norm(samples[:, 3:], axis=1, keepdims=True)
    curve = Trajectory(times, samples[:, :3], quaternions, like.periodic, like.ends)
    vars(curve)["coefficients"] = coefficients
    return curve


def refine(curve: Trajectory, cells: int) -> Trajectory:
    """The same curve on more pieces: its own breaks, and those of a grid of equal steps over its duration.

    Parameters
    ----------
    curve : Trajectory
        Unchanged.
    cells : int
        Steps of the grid.
    """
    breaks, step = np.asarray(curve.times, dtype=float), curve.duration / cells
    grid = curve.start + step * np.arange(cells + 1, dtype=np.float64)
    nearest = np.clip(np.round((breaks - curve.start) / step).astype(int), 0, cells)
    on_grid = np.abs(breaks - grid[nearest]) <= _BREAK_TOLERANCE * step
    grid[nearest[on_grid]] = breaks[on_grid]
    times = np.sort(np.concatenate([grid, breaks[~on_grid]]))
    piece = np.clip(np.searchsorted(breaks, times[:-1], side="right") - 1, 0, len(breaks) - 2)
    c0, c1, c2, c3 = (curve.coefficients[piece, power] for power in range(4))
    u = (times[:-1] - breaks[piece])[:, None]
    shifted = [c0 + u * (c1 + u * (c2 + u * c3)), c1 + u * (2.0 * c2 + 3.0 * u * c3), c2 + 3.0 * u * c3, c3]
    return _curve_of_pieces(times, np.ascontiguousarray(np.stack(shifted, axis=1)), curve)


def record_of(curve: Trajectory, width: float, depth: int) -> Array:
    """Record of a curve without edits, for the kernels of `controllers.curves.deformation`.

    Parameters
    ----------
    curve : Trajectory
        φ.
    width : float
        h, half the width of a bump [s]; it becomes an even number of steps of a grid, which changes it by up to h/16.
    depth : int
        Number of edits that can be undone.

    Raises
    ------
    CurveError
        If h is not positive, above half of the curve's duration or below 1/10 000 of it, or `depth` is not from 1 to
        `MAX_EDITS`.
    """
    if not 0.0 < width <= 0.5 * curve.duration:
        raise CurveError(
            f"a bump's half width must be above 0 s and at most half of the curve's {curve.duration:g} s, got {width}"
        )
    if curve.duration > _MAX_DURATION_RATIO * width:
        raise CurveError(
            f"a curve of {curve.duration:g} s cannot be bent by bumps of a half width of {width:g} s; expected "
            f"{curve.duration / _MAX_DURATION_RATIO:g} s or more"
        )
    if not 1 <= depth <= MAX_EDITS:
        raise CurveError(f"from 1 to {MAX_EDITS} edits can be undone, got {depth}")
    steps = np.diff(np.asarray(curve.times, dtype=float))
    # For a curve of equal steps the grid is a refinement of its breaks, so that steps stay equal.
    multiple = len(steps) if np.ptp(steps) <= _BREAK_TOLERANCE * steps[0] else 1
    cells = multiple * int(np.ceil(_STEPS_PER_HALF_WIDTH * curve.duration / (width * multiple)))
    step = curve.duration / cells
    fine = refine(curve, cells)
    packed, rows = fine.packed(), fine.coefficients.ravel()
    offsets = np.cumsum([RECORD_HEADER, EDIT * depth, len(rows), len(rows)])
    header = np.zeros(RECORD_HEADER)
    header[[STEP, DEPTH]] = step, depth
    header[HALF] = min(max(round(0.5 * width / step), 1), cells // 4)
    header[TABLE : TABLE + 4] = offsets  # also BASE, COMMITTED and WORK
    return np.concatenate([header, np.zeros(EDIT * depth), rows, rows, packed])


def curve_of(record: Array, at: int, like: Trajectory) -> Trajectory:
    """The bent curve of a record at ``record[at:]``, with the coefficients that the servo uses.

    Parameters
    ----------
    record, at
        Array and offset of the record.
    like : Trajectory
        The curve that the record was made from.
    """
    blob = record[work_curve.py_func(record, at) :]  # pyright: ignore[reportFunctionMemberAccess]
    pieces, breaks, rows = (int(blob[i]) for i in (PIECES, BREAKS, COEFFICIENTS))
    coefficients = blob[rows : rows + PIECE * pieces].reshape(pieces, 4, CHANNELS)
    return _curve_of_pieces(blob[breaks : breaks + pieces + 1].copy(), coefficients.copy(), like)
