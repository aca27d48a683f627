"""Inputs of laws besides the hand: each is written into a law's memory before every evaluation."""

from collections.abc import Callable
from typing import NamedTuple

from controllers.haptic_map.base import HapticMap
from controllers.state import HandState
from controllers.walking.walking import Walking
from geometry.arrays import Array


class Feed(NamedTuple):
    """An input of a law.

    Attributes
    ----------
    source : callable, HapticMap or Walking
        A Python function from the hand state to a wrench [F (3), τ (3)]; a haptic map, whose pose h (nq) and derivative
        h_* (nv × 6) at the stylus are written, its own memory behind them; or a walker, of which a `Followed` is.
    slot : int
        Offset in the memory.
    at : int
        Offset of the source's parameters among the field's; a function has none.
    """

    source: Callable[[HandState], Array] | HapticMap | Walking
    slot: int
    at: int = 0

    def moved(self, params: int, memory: int) -> "Feed":
        """The same feed with its offsets in the parameters and in the memory increased."""
        return self._replace(slot=self.slot + memory, at=self.at + params)
