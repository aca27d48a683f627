"""Bounding volumes of a spline for the search of its closest point: a binary tree of capsules."""

import numpy as np

from geometry.arrays import Array

NODE = 8  # numbers per node: start of the chord (3), chord (3), 1/|chord|², radius
_UNREACHABLE = 1e150  # [m] position of nodes without a piece, so that they are always out of reach


def capsule_tree(coefficients: Array, step: Array) -> tuple[Array, int]:
    """Capsules that contain every piece, every pair of pieces, every four, and so on to the whole curve.

    A capsule is the chord from the first to the last point of its run of pieces, thickened by the largest distance
    of a Bézier control point from it: being convex, it contains the pieces. Its radius shrinks with the *square* of
    the run's length, so that the bounds of very short pieces still separate the nearest one.

    Parameters
    ----------
    coefficients : Array, shape (n, 4, 3)
        Powers 1, u, u², u³ of the position on each piece [m].
    step : Array, shape (n,)
        Durations of the pieces [s].

    Returns
    -------
    tree : Array, shape (2 ** (levels + 1), 8)
        Node i has children 2i and 2i + 1; the root is 1, piece k is node 2 ** levels + k.
    levels : int
        Depth of the leaves.
    """
    n = len(coefficients)
    levels = int(np.ceil(np.log2(n)))
    h = step[:, None]
    c0, c1, c2, c3 = (coefficients[:, k] for k in range(4))
    end = c0 + h * (c1 + h * (c2 + h * c3))
    control = np.stack([c0, c0 + h * c1 / 3.0, c0 + 2.0 * h * c1 / 3.0 + h * h * c2 / 3.0, end], axis=1)
    tree = np.tile([_UNREACHABLE] * 3 + [0.0] * (NODE - 3), (2 ** (levels + 1), 1))
    for level in range(levels + 1):
        run = 2 ** (levels - level)
        firsts = np.arange(0, n, run)
        start, chord = c0[firsts], end[np.minimum(firsts + run, n) - 1] - c0[firsts]
        inverse = 1.0 / np.maximum(np.einsum("nx,nx->n", chord, chord), 1e-300)
        owner = np.arange(n) // run
        offset = control - start[owner][:, None]
        share = np.clip(np.einsum("nkx,nx->nk", offset, chord[owner]) * inverse[owner][:, None], 0.0, 1.0)
        distance = np.linalg.norm(offset - share[..., None] * chord[owner][:, None], axis=2).max(axis=1)
        nodes = slice(2**level, 2**level + len(firsts))
        # A small margin, so that rounding in the kernel's own projection on the chord cannot invalidate the bound.
        radius = np.maximum.reduceat(distance, firsts) + 1e-14
        tree[nodes] = np.column_stack([start, chord, inverse, radius])
    return tree, levels
