"""Laps of the hand: along the curve or, of several rivers, along the one that has the hand."""

import numpy as np

from geometry.arrays import Array, IntArray
from sim.recording.recording import Recording


def lap_durations(recording: Recording) -> Array:
    """Duration of a lap [s] of each river that a hand may be in, and last that of the curve, shape (k + 1,)."""
    start, end = recording.arrays["curve_span"]
    return np.append(recording.arrays.get("river_laps", np.empty(0)), end - start)


def counted_rivers(river: Array, spans: Array) -> IntArray:
    """The river of each tick as an index of `spans`; −1, the curve, in a run without rivers."""
    return river.astype(np.int64) if len(spans) > 1 else np.full(len(river), -1)


def lap_steps(phase: Array, river: IntArray, spans: Array, closed: bool) -> Array:
    """Laps from each tick to the next, shape (n − 1,); a change of river is no step along either.

    Parameters
    ----------
    phase : Array, shape (n,)
        Phase of the nearest point [s].
    river : IntArray, shape (n,)
        As from `counted_rivers`; −1 where none of several rivers has the hand, which then makes no laps.
    spans : Array, shape (k + 1,)
        As from `lap_durations`.
    closed : bool
        Whether the curve, if there are no rivers, is closed.
    """
    rivers = len(spans) > 1
    steps = np.diff(phase) / spans[river[1:]]
    if closed or rivers:
        steps -= np.round(steps)
    if rivers:
        steps[(np.diff(river) != 0) | (river[1:] < 0)] = 0.0
    return steps
