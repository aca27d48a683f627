"""Runs of True in a mask over frames: stances, and gaps between them."""

import numpy as np

from models.arrays import Mask

GAP, SHORT = 0.05, 0.06  # of stances: gaps shorter than this are filled, stances shorter than this dropped [s]


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Start and end indices of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(int), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def cleaned(mask: Mask, gap: int, short: int) -> Mask:
    """The mask with gaps shorter than `gap` filled, except at its ends, and runs shorter than `short` dropped."""
    mask = mask.copy()
    for start, end in runs(~mask):
        if end - start < gap and start > 0 and end < len(mask):
            mask[start:end] = True
    for start, end in runs(mask):
        if end - start < short:
            mask[start:end] = False
    return mask
