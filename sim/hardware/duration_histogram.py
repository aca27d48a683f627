"""A histogram of durations with quantiles, in constant memory."""

from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.arrays import Array, IntArray

BIN = 1e-6  # [s] width of a bin
_N_BINS = 100_000  # up to 0.1 s; longer times are counted in the last bin


class Quantiles(NamedTuple):
    """Quantiles of a duration [s]: median, 99 %, 99.9 %, the longest, and the number of samples."""

    p50: float
    p99: float
    p999: float
    longest: float
    times: int


class DurationHistogram(NamedTuple):
    """A histogram of durations: samples in each bin, shape (`_N_BINS`,), and the longest duration [s], shape (1,)."""

    counts: IntArray
    longest: Array

    @classmethod
    def empty(cls) -> "DurationHistogram":
        """An empty histogram."""
        return cls(np.zeros(_N_BINS, np.int64), np.zeros(1))

    def quantiles(self) -> Quantiles:
        """Quantiles of the samples; zeros if there are none."""
        cumulative = np.cumsum(self.counts)
        count = int(cumulative[-1])
        p50, p99, p999 = (float(np.searchsorted(cumulative, share * count) + 1) * BIN for share in (0.5, 0.99, 0.999))
        longest = float(self.longest[0])
        return Quantiles(min(p50, longest), min(p99, longest), min(p999, longest), longest, count)


@njit
def add_duration(spread: DurationHistogram, seconds: float) -> None:
    """Add a duration [s] to the histogram."""
    spread.counts[min(_N_BINS - 1, int(seconds / BIN))] += 1
    spread.longest[0] = max(spread.longest[0], seconds)
