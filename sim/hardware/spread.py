"""How long something took, over any number of times, in memory that does not grow."""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.state import Array, IntArray

BIN = 1e-6  # [s]
_BINS = 100_000  # so up to 0.1 s; what is longer is counted in the last


class Quantiles(NamedTuple):
    """Of a time [s]: middle, 99 and 99.9 of 100, the longest, and how often it was taken."""

    p50: float
    p99: float
    p999: float
    longest: float
    times: int


class Spread(NamedTuple):
    """Times counted by the microsecond: how many in each, shape (`_BINS`,), and the longest [s], shape (1,)."""

    counts: IntArray
    longest: Array

    @classmethod
    def empty(cls) -> "Spread":
        """Nothing is counted."""
        return cls(np.zeros(_BINS, np.int64), np.zeros(1))

    def quantiles(self) -> Quantiles:
        """What has been counted; zeros where nothing was."""
        total = np.cumsum(self.counts)
        count = int(total[-1])
        p50, p99, p999 = (float(np.searchsorted(total, share * count) + 1) * BIN for share in (0.5, 0.99, 0.999))
        longest = float(self.longest[0])
        return Quantiles(min(p50, longest), min(p99, longest), min(p999, longest), longest, count)


@njit
def count_time(spread: Spread, seconds: float) -> None:
    """Count a time [s]."""
    spread.counts[min(_BINS - 1, int(seconds / BIN))] += 1
    spread.longest[0] = max(spread.longest[0], seconds)
