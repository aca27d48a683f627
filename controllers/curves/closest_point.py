"""Closest point on a curve: the global minimum, exact on the spline, at a cost that hardly grows with its pieces.

On a cubic piece, d² = |φ(u) − p|² has degree 6 and its minima are roots of the quintic f = (φ − p)·φ̇. Pieces are
found by branch and bound over the tree of capsules. On a piece, sign variations of the Bernstein coefficients bound the
number of roots; the piece is halved until the roots are isolated, and a safeguarded Newton iteration refines each. So
no root is missed.

A warm start only tightens the first bound: it speeds the search up and cannot trap it in a local minimum. Of equally
near points (within 1e-11 m) the first one found is returned, which is that of the warm start.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.curves import trajectory as packed
from controllers.curves.bounds import NODE
from controllers.curves.trajectory import find_piece, piece_acceleration, piece_point, piece_velocity, wrap_phase
from controllers.work_array import work_array, work_integers
from geometry.arrays import Array, IntArray
from geometry.vectors import Vector

_TIE_TOLERANCE = 1e-11  # [m] a branch is searched only if it may improve the distance by more than this


@njit
def _quintic(blob: Array, row: int, u: float, px: float, py: float, pz: float) -> tuple[float, float]:
    """Quintic f = (φ − p)·φ̇ and f' = |φ̇|² + (φ − p)·φ̈ at u."""
    x, y, z = piece_point(blob, row, u)
    vx, vy, vz = piece_velocity(blob, row, u)
    x, y, z = x - px, y - py, z - pz
    ax, ay, az = piece_acceleration(blob, row, u)
    return x * vx + y * vy + z * vz, vx * vx + vy * vy + vz * vz + x * ax + y * ay + z * az


@njit
def _squared_distance(blob: Array, row: int, u: float, px: float, py: float, pz: float) -> float:
    x, y, z = piece_point(blob, row, u)
    return (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2


@njit
def _refine_root(blob: Array, row: int, low: float, high: float, px: float, py: float, pz: float) -> float:
    """Root of f between low (f < 0) and high (f > 0): Newton, bisecting whenever it leaves the bracket or stalls."""
    f_low, _ = _quintic(blob, row, low, px, py, pz)
    f_high, _ = _quintic(blob, row, high, px, py, pz)
    u = 0.5 * (low + high)
    if f_low < 0.0 < f_high:
        u = low - f_low * (high - low) / (f_high - f_low)
    resolution = 1e-15 * (abs(low) + abs(high))
    last = high - low
    for _ in range(100):
        f, slope = _quintic(blob, row, u, px, py, pz)
        if f == 0.0 or high - low <= resolution:
            break
        if f < 0.0:
            low = u
        else:
            high = u
        step = f / slope if slope > 0.0 else np.inf
        if not (low <= u - step <= high) or abs(step) > 0.5 * last:
            step = u - 0.5 * (low + high)
        last = abs(step)
        u -= step
        if last <= resolution:
            break
    return u


@njit
def _sign_variations(b: Array) -> int:
    """Sign variations of six Bernstein coefficients: an upper bound on the number of roots, of the same parity."""
    count, sign = 0, 0.0
    for k in range(6):
        if b[k] != 0.0:
            if sign * b[k] < 0.0:
                count += 1
            sign = 1.0 if b[k] > 0.0 else -1.0
    return count


class Pieces(NamedTuple):
    """Pieces of a packed curve: their number, the first leaf of their tree, and offsets of breaks, rows and tree."""

    number: int
    first_leaf: int
    breaks: int
    rows: int
    tree: int


@njit(forceinline=True)
def pieces_of(blob: Array, at: int) -> Pieces:
    """Pieces of the curve packed at ``blob[at:]``."""
    breaks, rows = at + int(blob[at + packed.BREAKS]), at + int(blob[at + packed.COEFFICIENTS])
    first_leaf = 1 << int(blob[at + packed.LEVELS])
    return Pieces(int(blob[at + packed.PIECES]), first_leaf, breaks, rows, at + int(blob[at + packed.TREE]))


@njit
def nearest_on_piece(
    blob: Array, pieces: Pieces, piece: int, px: float, py: float, pz: float, b: Array
) -> tuple[float, float]:
    """(d, t) of the point of one piece nearest to p; `b` is scratch of shape (48, 8)."""
    start, row = blob[pieces.breaks + piece], pieces.rows + piece * packed.PIECE
    h = blob[pieces.breaks + piece + 1] - start
    best, best_u = _squared_distance(blob, row, 0.0, px, py, pz), 0.0
    end = _squared_distance(blob, row, h, px, py, pz)
    if end < best:
        best, best_u = end, h
    for k in range(6):
        b[0, k] = 0.0
    for axis in range(3):
        c0, c1 = blob[row + axis] - (px, py, pz)[axis], blob[row + 7 + axis] * h
        c2, c3 = blob[row + 14 + axis] * h * h, blob[row + 21 + axis] * h * h * h
        q0, q1, q2, q3 = c0, c0 + c1 / 3.0, c0 + (2.0 * c1 + c2) / 3.0, c0 + c1 + c2 + c3
        d0, d1, d2 = q1 - q0, q2 - q1, q3 - q2
        # Product of Bernstein polynomials of degree 3 and 2, over the binomials of degree 5.
        b[0, 0] += q0 * d0
        b[0, 1] += (2.0 * q0 * d1 + 3.0 * q1 * d0) / 5.0
        b[0, 2] += (q0 * d2 + 6.0 * q1 * d1 + 3.0 * q2 * d0) / 10.0
        b[0, 3] += (3.0 * q1 * d2 + 6.0 * q2 * d1 + q3 * d0) / 10.0
        b[0, 4] += (3.0 * q2 * d2 + 2.0 * q3 * d1) / 5.0
        b[0, 5] += q3 * d2
    b[0, 6], b[0, 7] = 0.0, 1.0
    top = 1
    while top > 0:
        top -= 1
        row_b = b[top]
        low, high = row_b[6], row_b[7]
        variations = _sign_variations(row_b)
        if variations == 0 or (variations == 1 and row_b[5] < 0.0):
            continue
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(row_b[k]))
        # On an arc about p the quintic is only rounding error: stop once it can no longer change the distance.
        flat = 6.0 * largest * (high - low) <= 1e-20 + 1e-12 * best
        if variations == 1 or flat or top > 44:
            u = h * 0.5 * (low + high) if flat else _refine_root(blob, row, h * low, h * high, px, py, pz)
            square = _squared_distance(blob, row, u, px, py, pz)
            if square < best:
                best, best_u = square, u
            continue
        # De Casteljau at the middle: the left half stays in place, the right half goes above it on the stack.
        right = b[top + 1]
        for k in range(6):
            right[k] = row_b[k]
        for level in range(5):
            row_b[level] = right[0]
            for k in range(5 - level):
                right[k] = 0.5 * (right[k] + right[k + 1])
        row_b[5] = right[0]
        row_b[7], right[6], right[7] = 0.5 * (low + high), 0.5 * (low + high), high
        top += 2
    return math.sqrt(best), start + best_u


@njit
def chord_square(blob: Array, node: int, px: float, py: float, pz: float) -> float:
    """Squared distance from p to the chord of the capsule at ``blob[node]``."""
    x, y, z = px - blob[node], py - blob[node + 1], pz - blob[node + 2]
    dx, dy, dz = blob[node + 3], blob[node + 4], blob[node + 5]
    share = min(max((x * dx + y * dy + z * dz) * blob[node + 6], 0.0), 1.0)
    x, y, z = x - share * dx, y - share * dy, z - share * dz
    return x * x + y * y + z * z


@njit
def _is_out_of_reach(blob: Array, node: int, square: float, best: float) -> bool:
    """Whether no point of the capsule at ``blob[node]`` can be nearer than `best`; `square` is that to its chord."""
    reach = max(best - _TIE_TOLERANCE + blob[node + 7], 0.0)
    return square >= reach * reach


class _Scratch(NamedTuple):
    """Work arrays of a search: a stack of nodes, the squared distances to their chords, and that of a piece."""

    nodes: IntArray
    squares: Array
    piece: Array


@njit(forceinline=True)
def _leaf_near(blob: Array, at: int, pieces: Pieces, guess: float, px: float, py: float, pz: float) -> int:
    """Leaf of the piece at a phase, after a Newton step: the hand may have moved over some pieces since."""
    guess = wrap_phase(blob, at, guess)
    piece = find_piece(blob, at, guess)
    f, slope = _quintic(blob, pieces.rows + piece * packed.PIECE, guess - blob[pieces.breaks + piece], px, py, pz)
    if slope > 0.0:
        piece = find_piece(blob, at, wrap_phase(blob, at, guess - f / slope))
    return pieces.first_leaf + piece


@njit(forceinline=True)
def _search_below(
    blob: Array, pieces: Pieces, node: int, square: float, p: Vector, found: tuple[float, float], scratch: _Scratch
) -> tuple[float, float]:
    """(d, t) of the point nearest to p below a node of the tree, or those already `found` if none is nearer.

    `square` is the squared distance of p to the node's chord.
    """
    (px, py, pz), (best, best_t), (nodes, squares, work) = p, found, scratch
    nodes[0], squares[0] = node, square
    top = 1
    while top > 0:
        top -= 1
        node = int(nodes[top])
        if _is_out_of_reach(blob, pieces.tree + NODE * node, squares[top], best):
            continue
        if node < pieces.first_leaf:
            near, far = 2 * node, 2 * node + 1
            near_square = chord_square(blob, pieces.tree + NODE * near, px, py, pz)
            far_square = chord_square(blob, pieces.tree + NODE * far, px, py, pz)
            if far_square < near_square:
                near, far, near_square, far_square = far, near, far_square, near_square
            nodes[top], squares[top] = far, far_square
            nodes[top + 1], squares[top + 1] = near, near_square
            top += 2
        elif node - pieces.first_leaf < pieces.number:
            distance, t = nearest_on_piece(blob, pieces, node - pieces.first_leaf, px, py, pz, work)
            if distance < best - _TIE_TOLERANCE:
                best, best_t = distance, t
    return best, best_t


@njit
def closest_phase(blob: Array, at: int, px: float, py: float, pz: float, guess: float) -> tuple[float, float]:
    """Phase t* of the point of the curve packed at ``blob[at:]`` that is nearest to p, over the whole curve.

    Parameters
    ----------
    blob, at
        Array and offset of a packed `Trajectory`.
    px, py, pz : float
        p_H [m].
    guess : float
        Initial phase, such as the last t*; NaN for none. It affects the cost and ties, not the result.

    Returns
    -------
    t, distance : float
        t* [s] and |φ(t*) − p| [m], exact to 1e-11 m. NaN distance if p is not finite.
    """
    start = float(blob[at + packed.START])
    if not np.isfinite(px + py + pz):
        return start, np.nan
    pieces, found = pieces_of(blob, at), (math.inf, start)
    scratch = _Scratch(work_integers(64), work_array(64), work_array((48, 8)))
    # From the leaf of the guess upwards, the sibling of each ancestor is searched if it is in reach; without a guess,
    # the search starts at the root.
    below = _leaf_near(blob, at, pieces, guess, px, py, pz) if np.isfinite(guess) else 1
    node, square = below, 0.0
    while True:
        if not _is_out_of_reach(blob, pieces.tree + NODE * node, square, found[0]):
            found = _search_below(blob, pieces, node, square, (px, py, pz), found, scratch)
        if below == 1:
            return found[1], found[0]
        node, below = below ^ 1, below // 2
        head = pieces.tree + NODE * node
        square = chord_square(blob, head, px, py, pz)
        if _is_out_of_reach(blob, head, square, found[0]):
            continue
        if (px - blob[head]) ** 2 + (py - blob[head + 1]) ** 2 + (pz - blob[head + 2]) ** 2 < found[0] * found[0]:
            # Another run of pieces starts nearer, so the guess is far off: search from the root, with this bound.
            node, square, below = 1, 0.0, 1


@njit
def closest_phases(blob: Array, points: Array) -> tuple[Array, Array]:
    """Phases t* [s] and distances [m], shape (n,), of points (n, 3) along a path, each search started from the last."""
    phases, distances = np.empty(len(points)), np.empty(len(points))
    guess = np.nan
    for i in range(len(points)):
        guess, distances[i] = closest_phase(blob, 0, points[i, 0], points[i, 1], points[i, 2], guess)
        phases[i] = guess
    return phases, distances
