"""Branches of a curve near a point: every part of it that passes through a ball, with its own closest point.

A branch is a connected part of φ⁻¹(B(p, ε)). Where the radius of curvature exceeds ε, d² is convex along a branch, so
each has exactly one closest point, which moves continuously with p. A curve that crosses itself thus has two distinct
branches at the crossing.
"""

import math

import numpy as np
from numba import njit

from controllers.curves.bounds import NODE
from controllers.curves.closest_point import Pieces, chord_square, nearest_on_piece, pieces_of
from controllers.curves.trajectory import PERIODIC
from controllers.work_array import work_array, work_integers
from geometry.arrays import Array, IntArray

BRANCHES = 8  # largest number of branches of one curve that are found; others are ignored

SAME_BRANCH = 0.1
"""Largest change of phase from one tick to the next, as a fraction of the lap, at which a branch counts as the same."""


@njit
def _find_runs(
    blob: Array, pieces: Pieces, px: float, py: float, pz: float, radius: float, runs: IntArray, scratch: Array
) -> int:
    """Write the runs of pieces nearer than the radius, as rows [first, last, likely nearest]; returns their number."""
    nodes = work_integers(64)
    nodes[0] = 1
    top, count = 1, 0
    likely = math.inf
    while top > 0:
        top -= 1
        node = nodes[top]
        chord = math.sqrt(chord_square(blob, pieces.tree + NODE * node, px, py, pz))
        thickness = blob[pieces.tree + NODE * node + 7]
        if chord - thickness >= radius:
            continue
        if node < pieces.first_leaf:
            # The left child is popped first, so that pieces are visited in the order of their phases.
            nodes[top], nodes[top + 1] = 2 * node + 1, 2 * node
            top += 2
            continue
        piece = int(node) - pieces.first_leaf
        if chord + thickness >= radius and nearest_on_piece(blob, pieces, piece, px, py, pz, scratch)[0] >= radius:
            continue
        if count == 0 or runs[count - 1, 1] != piece - 1:
            if count == BRANCHES:
                break
            runs[count, 0] = piece
            likely = math.inf
            count += 1
        runs[count - 1, 1] = piece
        if chord < likely:
            likely, runs[count - 1, 2] = chord, piece
    return count


@njit
def branches(blob: Array, at: int, px: float, py: float, pz: float, radius: float, found: Array) -> int:
    """Closest points of all branches of the curve packed at ``blob[at:]`` within a ball.

    The cost is proportional to the number of pieces within the ball.

    Parameters
    ----------
    blob, at
        Array and offset of a packed `Trajectory`.
    px, py, pz : float
        p_H [m].
    radius : float
        ε [m], may be infinite: the whole curve is then one branch.
    found : Array, shape (BRANCHES, 2)
        Written: phase [s] and distance [m] of each branch.

    Returns
    -------
    int
        Number of branches; 0 if p is not finite.
    """
    if not np.isfinite(px + py + pz):
        return 0
    runs, scratch, pieces = work_integers((BRANCHES, 3)), work_array((48, 8)), pieces_of(blob, at)
    count = _find_runs(blob, pieces, px, py, pz, radius, runs, scratch)
    if count > 1 and blob[at + PERIODIC] > 0.0 and runs[0, 0] == 0 and runs[count - 1, 1] == pieces.number - 1:
        # One branch across the seam; its last piece lies before its first.
        count -= 1
        runs[0, 0] = runs[count, 0] - pieces.number
    for k in range(count):
        best: float = math.inf
        # The likely nearest piece first: its distance then rules out most others.
        for turn in range(runs[k, 0] - 1, runs[k, 1] + 1):
            piece = int(runs[k, 2] if turn < runs[k, 0] else turn % pieces.number)
            leaf = pieces.tree + NODE * (pieces.first_leaf + piece)
            bound = best + blob[leaf + 7]
            again = turn >= runs[k, 0] and piece == runs[k, 2]
            if again or chord_square(blob, leaf, px, py, pz) >= bound * bound:
                continue
            distance, t = nearest_on_piece(blob, pieces, piece, px, py, pz, scratch)
            if distance < best:
                best = distance
                found[k, 0], found[k, 1] = t, distance
    return count
