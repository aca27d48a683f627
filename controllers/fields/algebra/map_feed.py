"""Inputs of laws from a haptic map: its pose and derivative at the stylus, written to their memory at each tick.

The servo calls `feed_maps` before `evaluate`, so the kernels of the laws do not depend on those of the maps.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.fields.algebra.feed import Feed
from controllers.haptic_map.base import STYLUS, STYLUS_TANGENT, HapticMap
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


def unlinked_maps(feeds: tuple[Feed, ...]) -> Maps:
    """The maps among a field's feeds, without the addresses of their kernels."""
    rows, stages = list[list[int]](), np.zeros((0, 3), dtype=np.int64)
    for source, slot, at in feeds:
        if isinstance(source, HapticMap):
            first, stages = len(stages), np.concatenate([stages, source.compiled().stages])
            rows.append([slot, at, first, len(stages), source.nq, source.nv])
    return Maps(np.array(rows, dtype=np.int64).reshape(-1, len(_Column)), stages)


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
