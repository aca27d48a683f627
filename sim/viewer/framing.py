"""Framing of a replay: a scale for force arrows, and a view that follows a travelling figure."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from geometry.arrays import Array
from sim.recording.recording import Channel

MAX_TRAVEL = 1.5  # [m] a figure that leaves this radius is followed


def typical_peak(channel: Channel) -> float:
    """The 99.5 % quantile of the rows' norms, so that a jolt does not shrink all other arrows."""
    return float(np.percentile(np.linalg.norm(channel[:: max(1, len(channel) // 20000)], axis=1), 99.5))


def view_offsets(roots: Array, fps: float) -> Array:
    """Horizontal offset of the view (n, 2) [m]: the path of a travelling root smoothed over 1 s; else zero.

    Parameters
    ----------
    roots : array (n, 2)
        Positions of the root on the floor [m], at equal time steps.
    fps : float
        Their rate [1/s].
    """
    if np.max(np.linalg.norm(roots - roots[0], axis=1)) < MAX_TRAVEL:
        return np.zeros_like(roots)
    return uniform_filter1d(roots, int(fps) | 1, axis=0, mode="nearest")
