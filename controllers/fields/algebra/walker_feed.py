"""Inputs of laws from a walker: it is advanced, and what they read of it is written to their memory, in each tick.

The servo calls `feed_walkers` before `evaluate`. The walkers of a field are a state beside its memory: laws only read
what they are told of them (`controllers.walking.walking.Followed`), and a haptic map may read them, too.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.fields.algebra.instructions import LAW_ARGUMENTS
from controllers.kernel_call import kernel_call
from controllers.state import Array, IntArray
from controllers.walking.walking import Walking

_call = kernel_call(LAW_ARGUMENTS)


class _Row(IntEnum):
    """Places in a row of `Walkers.feeds`."""

    KERNEL = 0
    SLOT = 1
    AT = 2
    PLACE = 3


class WalkerFeed(NamedTuple):
    """What a law reads of a walker, written into its memory.

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
        A row each: address of the kernel (0 until linked), `slot`, `at`, and offset of its walker in `state`.
    state : Array
        Numbers of the walkers, one after the other; written.
    """

    feeds: IntArray
    state: Array

    def linked(self, kernel: int) -> "Walkers":
        """The same walkers with the address of the kernel `controllers.walking.walking.follow_hand`."""
        feeds = self.feeds.copy()
        feeds[:, _Row.KERNEL] = kernel
        return self._replace(feeds=feeds)


def fresh_walkers(feeds: tuple[WalkerFeed, ...]) -> Walkers:
    """Walkers for a new run, one for each walking that the feeds name; not linked."""
    states: list[Array] = []
    places: dict[int, int] = {}
    for feed in feeds:
        if id(feed.walking) not in places:
            places[id(feed.walking)] = sum(map(len, states))
            states.append(feed.walking.fresh())
    rows = np.array([[0, slot, at, places[id(walking)]] for slot, at, walking in feeds], dtype=np.int64)
    return Walkers(rows.reshape(-1, len(_Row)), np.concatenate([np.zeros(0), *states]))


@njit
def feed_walkers(walkers: Walkers, params: Array, memory: Array, hand: Array) -> None:
    """Advance the walkers of a field to the hand's time, and write what its laws read of them into its memory.

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
            rows[n, _Row.KERNEL],
            (params, rows[n, _Row.AT], rows[n, _Row.SLOT], walkers.state, rows[n, _Row.PLACE], hand, memory),
        )
