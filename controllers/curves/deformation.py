r"""Deformable curves: compact C² bumps added to a spline in place, with undo and redo.

.. math:: \varphi'(t) = \varphi(t) + \sum_j w\bigl((t - \hat t_j)/h_j\bigr)\,\hat\delta_j, \qquad
          \hat\delta_j = \delta_j / w\bigl((t_j - \hat t_j)/h_j\bigr)

w is the cubic B-spline, so φ′ is a cubic spline on the *same* pieces as φ, provided that the breaks of w are breaks of
φ. Therefore the curve is refined once, exactly, by a grid of phases; a bump is centred at the grid point t̂_j nearest
to the grasped phase t_j, and δ̂_j is scaled so that still φ′(t_j) = φ(t_j) + δ_j. A bump changes only the coefficients
of the pieces under it, and laws and searches run on the bent curve as on any other.

A *record* holds all this in one array: a header, the table of edits [t̂ [s], h [s], δ̂ (3) [m]], the coefficients of
the curve before all edits and after the committed ones, and the packed curve itself, which includes the pending edit.
"""

import numpy as np
from numba import njit

from controllers.curves import trajectory as packed
from controllers.curves.bounds import NODE
from controllers.curves.closest_point import chord_square
from controllers.curves.trajectory import curve_point, find_piece, wrap_phase
from geometry.arrays import Array

# The record's header: step of the grid [s]; h/2 [steps]; number of edits in force, and including those undone; capacity
# of the table; TABLE to WORK are offsets from the start; then the grasped phase, its point (3), the pending edit.
STEP, HALF, COUNT, TOTAL, DEPTH, TABLE, BASE, COMMITTED, WORK, PHASE, ANCHOR, PENDING = *range(10), 10, 13
RECORD_HEADER = 18
EDIT = 5  # numbers per edit


@njit
def bump(s: float) -> float:
    """Cubic B-spline w = 2⟨1 − |s|⟩³ − 8⟨½ − |s|⟩³: C², w(0) = 1, and 0 from |s| = 1 on."""
    outer, inner = np.maximum(0.0, 1.0 - np.abs(s)), np.maximum(0.0, 0.5 - np.abs(s))
    return 2.0 * outer * outer * outer - 8.0 * inner * inner * inner


@njit
def work_curve(record: Array, at: int) -> int:
    """Offset of the packed bent curve in the array that contains a record at ``record[at:]``."""
    return at + int(record[at + WORK])


@njit
def _add_bump(record: Array, at: int, edit: int, source: int, target: int) -> tuple[int, int]:
    """Write source + bump to target on the pieces under the edit at ``record[edit:]``; return first piece and count."""
    curve = work_curve(record, at)
    breaks, n = curve + int(record[curve + packed.BREAKS]), int(record[curve + packed.PIECES])
    centre, width = record[edit], record[edit + 1]
    period = record[curve + packed.END] - record[curve + packed.START] if record[curve + packed.PERIODIC] > 0.0 else 0.0
    first = find_piece(record, curve, wrap_phase(record, curve, centre - width + 1e-6 * record[at + STEP]))
    piece, count = first, 0
    while count < n and piece < n:
        half = 0.5 * (record[breaks + piece + 1] - record[breaks + piece])
        middle = record[breaks + piece] + half - centre
        if period > 0.0:
            middle -= period * np.floor(middle / period + 0.5)
        if middle >= width:
            break
        side = 1.0 if middle > 0.0 else -1.0
        inner = 4.0 if abs(middle) < 0.5 * width else 0.0
        outside = 1.0 - side * (middle - half) / width
        inside = outside - 0.5
        # Taylor coefficients of w at the break: the pieces of w end at breaks of the curve, so w is one cubic here.
        taylor = (
            2.0 * outside**3 - 2.0 * inner * inside**3,
            -side * 6.0 * (outside**2 - inner * inside**2) / width,
            6.0 * (outside - inner * inside) / width**2,
            -side * 2.0 * (1.0 - inner) / width**3,
        )
        row = packed.PIECE * piece
        for power in range(4):
            for axis in range(3):
                i = row + 7 * power + axis
                record[target + i] = record[source + i] + taylor[power] * record[edit + 2 + axis]
        count += 1
        piece += 1
        if piece == n and period > 0.0:
            piece = 0
    return first, count


@njit
def _set_chord(record: Array, node: int, x: float, y: float, z: float) -> None:
    record[node + 3], record[node + 4], record[node + 5] = x, y, z
    record[node + 6] = 1.0 / max(x * x + y * y + z * z, 1e-300)


@njit
def _bound_piece(record: Array, node: int, row: int, h: float) -> None:
    """Capsule of one piece: its chord, thickened by the inner two Bézier control points (the outer two lie on it)."""
    for i in range(3):
        record[node + i] = record[row + i]
    a, b = h / 3.0, h * h / 3.0
    dx = h * (record[row + 7] + h * (record[row + 14] + h * record[row + 21]))
    dy = h * (record[row + 8] + h * (record[row + 15] + h * record[row + 22]))
    dz = h * (record[row + 9] + h * (record[row + 16] + h * record[row + 23]))
    _set_chord(record, node, dx, dy, dz)
    x, y, z = record[row], record[row + 1], record[row + 2]
    x, y, z = x + a * record[row + 7], y + a * record[row + 8], z + a * record[row + 9]
    radius = np.sqrt(chord_square(record, node, x, y, z))
    x, y, z = x + a * record[row + 7], y + a * record[row + 8], z + a * record[row + 9]
    x, y, z = x + b * record[row + 14], y + b * record[row + 15], z + b * record[row + 16]
    record[node + 7] = max(radius, np.sqrt(chord_square(record, node, x, y, z))) + 1e-14


@njit
def _join_capsules(record: Array, node: int, left: int, right: int) -> None:
    """Capsule that contains those of two runs, the second of which begins where the first ends."""
    for i in range(3):
        record[node + i] = record[left + i]
    x, y, z = record[right], record[right + 1], record[right + 2]
    _set_chord(
        record, node, x + record[right + 3] - record[left], y + record[right + 4] - record[left + 1],
        z + record[right + 5] - record[left + 2],
    )  # fmt: skip
    thicker = max(record[left + 7], record[right + 7])
    record[node + 7] = np.sqrt(chord_square(record, node, x, y, z)) + thicker + 1e-14


@njit
def bound_pieces(record: Array, curve: int, first: int, count: int) -> None:
    """Update the capsules (see `controllers.curves.bounds`) of some pieces, and of all runs that contain one of them.

    The radius of a run's capsule is the distance of the joint of its halves from its chord plus the larger radius of
    the halves: at most a third larger than necessary on a smooth curve, at a cost proportional to the number of pieces.
    """
    tree, rows = curve + int(record[curve + packed.TREE]), curve + int(record[curve + packed.COEFFICIENTS])
    breaks, leaf = curve + int(record[curve + packed.BREAKS]), 1 << int(record[curve + packed.LEVELS])
    for piece in range(first, first + count):
        h = record[breaks + piece + 1] - record[breaks + piece]
        _bound_piece(record, tree + NODE * (leaf + piece), rows + packed.PIECE * piece, h)
    low, high, last = leaf + first, leaf + first + count - 1, leaf + int(record[curve + packed.PIECES]) - 1
    while low > 1:
        low, high = low // 2, high // 2
        for number in range(low, high + 1):
            node, left = tree + NODE * number, tree + NODE * 2 * number
            if 2 * number < last:
                _join_capsules(record, node, left, left + NODE)
            else:
                record[node : node + NODE] = record[left : left + NODE]
        last //= 2


@njit
def _bound_run(record: Array, curve: int, first: int, count: int) -> None:
    """`bound_pieces` for a run that may continue beyond the seam of a periodic curve."""
    before = min(count, int(record[curve + packed.PIECES]) - first)
    bound_pieces(record, curve, first, before)
    if count > before:
        bound_pieces(record, curve, 0, count - before)


@njit
def _copy_pieces(record: Array, at: int, source: int, target: int) -> None:
    length = packed.PIECE * int(record[work_curve(record, at) + packed.PIECES])
    record[target : target + length] = record[source : source + length]


@njit
def discard_edit(record: Array, at: int) -> None:
    """Discard the pending edit: the curve is restored, bit for bit, to the state after the committed edits."""
    curve = work_curve(record, at)
    rows = curve + int(record[curve + packed.COEFFICIENTS])
    _copy_pieces(record, at, at + int(record[at + COMMITTED]), rows)
    bound_pieces(record, curve, 0, int(record[curve + packed.PIECES]))


@njit
def begin_edit(record: Array, at: int, phase: float) -> bool:
    """Begin an edit at a phase t_j; returns False if an end of an open curve, which stays fixed, is too near.

    The half width is h, or near an end of an open curve the distance to it, but not below h/4.
    """
    curve, step = work_curve(record, at), record[at + STEP]
    phase = wrap_phase(record, curve, phase)
    cell = int(np.floor((phase - record[curve + packed.START]) / step + 0.5))
    half = int(record[at + HALF])
    if record[curve + packed.PERIODIC] == 0.0:
        to_end = int(np.floor((record[curve + packed.END] - record[curve + packed.START]) / step + 0.5)) - cell
        half = min(half, min(cell, to_end) // 2)
        if 4 * half < record[at + HALF]:
            return False
    record[at + PHASE] = phase
    record[at + ANCHOR], record[at + ANCHOR + 1], record[at + ANCHOR + 2] = curve_point(record, curve, phase)
    record[at + PENDING] = record[curve + packed.START] + cell * step
    record[at + PENDING + 1] = 2 * half * step
    for i in range(3):
        record[at + PENDING + 2 + i] = 0.0
    return True


@njit
def drag_to(record: Array, at: int, x: float, y: float, z: float) -> None:
    """Bend the curve under the bump so that φ′(t_j) is at a given position in H [m]."""
    edit, curve = at + PENDING, work_curve(record, at)
    weight = bump((record[at + PHASE] - record[edit]) / record[edit + 1])
    record[edit + 2] = (x - record[at + ANCHOR]) / weight
    record[edit + 3] = (y - record[at + ANCHOR + 1]) / weight
    record[edit + 4] = (z - record[at + ANCHOR + 2]) / weight
    rows = curve + int(record[curve + packed.COEFFICIENTS])
    first, count = _add_bump(record, at, edit, at + int(record[at + COMMITTED]), rows)
    _bound_run(record, curve, first, count)


@njit
def commit(record: Array, at: int) -> None:
    """Commit the pending edit; edits that were undone can no longer be redone.

    If the table is full, the oldest edit becomes part of the base curve and can no longer be undone.
    """
    table, committed, base = at + int(record[at + TABLE]), at + int(record[at + COMMITTED]), at + int(record[at + BASE])
    _add_bump(record, at, at + PENDING, committed, committed)
    count = int(record[at + COUNT])
    if count == int(record[at + DEPTH]):
        _add_bump(record, at, table, base, base)
        for i in range(table, table + EDIT * (count - 1)):
            record[i] = record[i + EDIT]
        count -= 1
    for i in range(EDIT):
        record[table + EDIT * count + i] = record[at + PENDING + i]
    record[at + COUNT] = record[at + TOTAL] = count + 1


@njit
def _replay(record: Array, at: int, count: int) -> None:
    """Apply the first `count` edits of the table to the base curve, in their original order."""
    committed = at + int(record[at + COMMITTED])
    _copy_pieces(record, at, at + int(record[at + BASE]), committed)
    for edit in range(count):
        _add_bump(record, at, at + int(record[at + TABLE]) + EDIT * edit, committed, committed)
    record[at + COUNT] = count
    discard_edit(record, at)


@njit
def undo(record: Array, at: int) -> bool:
    """Undo the last edit, bit for bit; returns False if there is none."""
    count = int(record[at + COUNT])
    if count > 0:
        _replay(record, at, count - 1)
    return count > 0


@njit
def redo(record: Array, at: int) -> bool:
    """Redo the edit that was undone last; returns False if there is none."""
    count, again = int(record[at + COUNT]), record[at + TOTAL] > record[at + COUNT]
    if again:
        _replay(record, at, count + 1)
    return again
