"""Spans of a mask over frames: runs of True, also round a lap, and a mask without spans that are too short."""

import numpy as np

from geometry.arrays import Mask


def spans(mask: Mask) -> list[tuple[int, int]]:
    """First frame of each run of True in a mask (n,), and the first frame after it."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(int), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def cyclic_spans(mask: Mask) -> list[tuple[int, int]]:
    """First sample of each run of True in a mask round a lap, and the first one after it, which may exceed the length.

    A mask that is constant has no runs.
    """
    n = len(mask)
    starts = np.flatnonzero(mask & ~np.roll(mask, 1))
    last = np.flatnonzero(mask & ~np.roll(mask, -1)) + 1
    ends = np.append(last, last + n)
    return [(int(start), int(ends[ends > start][0])) for start in starts]


def cleaned(mask: Mask, gap: int, short: int, closed: bool = False) -> Mask:
    """The mask with gaps shorter than `gap` filled, except at its ends, and runs shorter than `short` dropped.

    A mask that is True throughout keeps its run, however short: what is before and after it is unknown. A closed one,
    whose last frame repeats the first, has no ends.
    """
    if closed and len(mask) > 1:
        lap = mask[:-1]
        lap = cleaned(np.tile(lap, 3), gap, short)[len(lap) : 2 * len(lap)]
        return np.append(lap, lap[0])
    mask = mask.copy()
    for start, end in spans(~mask):
        if end - start < gap and start > 0 and end < len(mask):
            mask[start:end] = True
    for start, end in spans(mask):
        if end - start < min(short, len(mask)):
            mask[start:end] = False
    return mask
