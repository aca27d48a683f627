"""Inputs of laws from a haptic map: its pose and derivative at the stylus, written to their memory in each tick.

The servo calls `feed_maps` before `evaluate`, so the kernels of the laws do not depend on those of the maps.
"""

import numpy as np
from numba import njit

from controllers.fields.algebra.law import MapFeed
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT
from controllers.haptic_map.evaluate import evaluate_map_jacobian
from controllers.state import HAND_POSITION, Array, IntArray


def feed_rows(feeds: tuple[MapFeed, ...]) -> IntArray:
    """A field's `map_feeds` as numbers, shape (n, 6): slot, at, kind of map, number of parameters, nq, nv."""
    rows = np.zeros((len(feeds), 6), dtype=np.int64)
    for row, (slot, at, haptic_map) in zip(rows, feeds, strict=True):
        kind, params, _ = haptic_map.compiled()
        row[:] = slot, at, kind, len(params), haptic_map.nq, haptic_map.nv
    return rows


@njit
def feed_maps(units: IntArray, feeds: IntArray, params: Array, memory: Array, hand: Array) -> None:
    """Write h and h_* of the maps of a field into its memory, where its laws find them.

    Parameters
    ----------
    units : IntArray
        Addresses of the maps' kernels (see `controllers.haptic_map.evaluate`).
    feeds : IntArray
        See `feed_rows`.
    params, memory, hand
        As in `controllers.fields.algebra.program.evaluate`.
    """
    stylus = hand[HAND_POSITION : HAND_POSITION + STYLUS]
    for n in range(feeds.shape[0]):
        slot, at, kind = feeds[n, 0], feeds[n, 1], feeds[n, 2]
        size, nq, nv = feeds[n, 3], feeds[n, 4], feeds[n, 5]
        first, last = slot + nq, slot + nq + nv * STYLUS_TANGENT
        pose, jacobian = memory[slot:first], memory[first:last].reshape((nv, STYLUS_TANGENT))
        evaluate_map_jacobian(units, kind, params[at : at + size], stylus, memory[last:], pose, jacobian)
