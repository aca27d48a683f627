"""Inputs of laws from a haptic map: its pose and derivative at the stylus, written to their memory at each tick.

The servo calls `feed_maps` before `evaluate`, so the kernels of the laws do not depend on those of the maps.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.fields.algebra.law import MapFeed
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT
from controllers.haptic_map.map_stages import evaluate_map_jacobian
from controllers.state import HAND_POSITION
from geometry.arrays import Array, IntArray


class _Column(IntEnum):
    """Columns of `Maps.feeds`."""

    SLOT = 0
    AT = 1
    FIRST = 2
    LAST = 3
    NQ = 4
    NV = 5


class Maps(NamedTuple):
    """The haptic maps of a field.

    Attributes
    ----------
    feeds : IntArray, shape (n, 6)
        One row per map: `slot`, `at`, its first stage in `stages` and the one after its last, nq, nv.
    stages : IntArray, shape (m, 3)
        Stages of all maps, linked or not (`controllers.haptic_map.map_stages`).
    """

    feeds: IntArray
    stages: IntArray


def unlinked_maps(feeds: tuple[MapFeed, ...]) -> Maps:
    """The maps of a field's `map_feeds`, without the addresses of their kernels."""
    rows, stages = np.zeros((len(feeds), len(_Column)), dtype=np.int64), np.zeros((0, 3), dtype=np.int64)
    for row, (slot, at, haptic_map) in zip(rows, feeds, strict=True):
        first, stages = len(stages), np.concatenate([stages, haptic_map.compiled().stages])
        row[:] = slot, at, first, len(stages), haptic_map.nq, haptic_map.nv
    return Maps(rows, stages)


@njit
def feed_maps(maps: Maps, params: Array, memory: Array, hand: Array) -> None:
    """Write h and h_* of the maps of a field into its memory, where its laws find them.

    Parameters
    ----------
    maps : Maps
        With the addresses of the maps' kernels.
    params, memory, hand
        As in `controllers.fields.algebra.program.evaluate`.
    """
    stylus = hand[HAND_POSITION : HAND_POSITION + STYLUS]
    for n in range(maps.feeds.shape[0]):
        row = maps.feeds[n]
        slot, nq, nv = row[_Column.SLOT], row[_Column.NQ], row[_Column.NV]
        first, last = slot + nq, slot + nq + nv * STYLUS_TANGENT
        pose, jacobian = memory[slot:first], memory[first:last].reshape((nv, STYLUS_TANGENT))
        stages = maps.stages[row[_Column.FIRST] : row[_Column.LAST]]
        evaluate_map_jacobian(stages, params[row[_Column.AT] :], stylus, memory[last:], pose, jacobian)
