"""How long something took, over any number of times, in memory that does not grow."""

from array import array
from typing import NamedTuple

import numpy as np

BIN = 1e-6  # [s]
_BINS = 100_000  # so up to 0.1 s; what is longer is counted in the last


class Quantiles(NamedTuple):
    """Of a time [s]: middle, 99 and 99.9 of 100, the longest, and how often it was taken."""

    p50: float
    p99: float
    p999: float
    longest: float
    times: int


class Spread:
    """Counts times by the microsecond."""

    def __init__(self) -> None:
        self._counts = array("q", bytes(8 * _BINS))
        self._longest = 0.0

    def add(self, seconds: float) -> None:
        """Count a time [s]."""
        self._counts[min(_BINS - 1, int(seconds / BIN))] += 1
        self._longest = max(self._longest, seconds)

    def quantiles(self) -> Quantiles:
        """What has been counted; zeros where nothing was."""
        total = np.cumsum(np.frombuffer(self._counts, np.int64))
        count = int(total[-1])
        p50, p99, p999 = (float(np.searchsorted(total, share * count) + 1) * BIN for share in (0.5, 0.99, 0.999))
        longest = self._longest
        return Quantiles(min(p50, longest), min(p99, longest), min(p999, longest), longest, count)
