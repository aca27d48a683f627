"""Inputs of laws from a walker: at each tick it is advanced, and its state is written to the memory of the laws.

The servo calls `feed_walkers` before `evaluate`. The walkers of a field are a state separate from its memory: laws only
read their copy of it (`controllers.walking.walking.WalkerState`). A haptic map may read the walkers, too.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.fields.algebra.feed import Feed
from controllers.fields.algebra.instructions import LAW_ARGUMENTS
from controllers.kernel_call import kernel_call
from controllers.walking.walking import Walking
from geometry.arrays import Array, IntArray

_call = kernel_call(LAW_ARGUMENTS)


class _Column(IntEnum):
    """Columns of `Walkers.feeds`."""

    KERNEL = 0
    SLOT = 1
    AT = 2
    PLACE = 3


class Walkers(NamedTuple):
    """The walkers of a field.

    Attributes
    ----------
    feeds : IntArray, shape (n, 4)
        One row per feed: address of the kernel (0 until linked), `slot`, `at`, and offset of its walker in `state`.
    state : Array
        State of the walkers, one after the other; written.
    """

    feeds: IntArray
    state: Array

    def linked(self, kernel: int) -> "Walkers":
        """The same walkers with the address of the kernel `controllers.walking.walking.follow_hand`."""
        feeds = self.feeds.copy()
        feeds[:, _Column.KERNEL] = kernel
        return self._replace(feeds=feeds)


def fresh_walkers(feeds: tuple[Feed, ...]) -> Walkers:
    """Walkers for a new run, one for each `Walking` among a field's feeds; not linked."""
    states, offsets, rows = list[Array](), dict[int, int](), list[list[int]]()
    for source, slot, at in feeds:
        if isinstance(source, Walking):
            if id(source) not in offsets:
                offsets[id(source)] = sum(map(len, states))
                states.append(source.fresh())
            rows.append([0, slot, at, offsets[id(source)]])
    table = np.array(rows, dtype=np.int64).reshape(-1, len(_Column))
    return Walkers(table, np.concatenate([np.zeros(0), *states]))


@njit
def feed_walkers(walkers: Walkers, params: Array, memory: Array, hand: Array) -> None:
    """Advance the walkers of a field to the hand's time, and write the state that its laws read into its memory.

    Parameters
    ----------
    walkers : Walkers
        Linked; their state is written.
    params, memory, hand
        As in `controllers.fields.algebra.program.evaluate`.
    """
    rows = walkers.feeds
    for n in range(rows.shape[0]):
        _call(
            rows[n, _Column.KERNEL],
            (params, rows[n, _Column.AT], rows[n, _Column.SLOT], walkers.state, rows[n, _Column.PLACE], hand, memory),
        )
