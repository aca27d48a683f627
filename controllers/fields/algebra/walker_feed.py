"""Inputs of laws from a walker: at each tick it is advanced, and its state is written to the memory of the laws.

The servo calls `feed_walkers` before `evaluate`. The walkers of a field are a state separate from its memory: laws only
read their copy of it (`controllers.walking.walking.WalkerState`). A haptic map may read the walkers, too.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

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


class WalkerFeed(NamedTuple):
    """The part of a walker's state that a law reads, written into its memory.

    Attributes
    ----------
    slot : int
        Offset of a `Followed` in the memory.
    at : int
        Offset of the walking's parameters among the field's.
    walking : Walking
    """

    slot: int
    at: int
    walking: Walking

    def moved(self, params: int, memory: int) -> "WalkerFeed":
        """The same feed with its offsets in the parameters and in the memory increased."""
        return self._replace(slot=self.slot + memory, at=self.at + params)


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


def fresh_walkers(feeds: tuple[WalkerFeed, ...]) -> Walkers:
    """Walkers for a new run, one for each `Walking` of the feeds; not linked."""
    states: list[Array] = []
    offsets: dict[int, int] = {}
    for feed in feeds:
        if id(feed.walking) not in offsets:
            offsets[id(feed.walking)] = sum(map(len, states))
            states.append(feed.walking.fresh())
    rows = np.array([[0, slot, at, offsets[id(walking)]] for slot, at, walking in feeds], dtype=np.int64)
    return Walkers(rows.reshape(-1, len(_Column)), np.concatenate([np.zeros(0), *states]))


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
