"""Runs of True in a cyclic mask over the samples of a lap."""

import numpy as np

from geometry.arrays import Mask


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First sample of each run of True in a cyclic mask, and the first sample after it, which may exceed the length.

    A mask that is constant has no runs.
    """
    n = len(mask)
    starts = np.flatnonzero(mask & ~np.roll(mask, 1))
    last = np.flatnonzero(mask & ~np.roll(mask, -1)) + 1
    ends = np.append(last, last + n)
    return [(int(start), int(ends[ends > start][0])) for start in starts]
