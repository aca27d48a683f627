"""What keeps a replay in the picture: arrows of a length that fits, and a camera that follows a figure that travels."""

import numpy as np

from controllers.state import Array
from sim.recording.recording import Channel

TRAVEL = 1.5  # a figure that leaves this radius is followed [m]


def typical_peak(channel: Channel) -> float:
    """Norm that only a two-hundredth of the rows exceeds, so that a jolt does not shrink all other arrows."""
    return float(np.percentile(np.linalg.norm(channel[:: max(1, len(channel) // 20000)], axis=1), 99.5))


def followed(roots: Array, fps: float) -> Array:
    """What is subtracted from positions on the floor: nothing, or the path of a travelling root, smoothed over 1 s.

    Parameters
    ----------
    roots : array (n, 2)
        [m], at equal steps of time.
    fps : float
        Of them [1/s].
    """
    if np.max(np.linalg.norm(roots - roots[0], axis=1)) < TRAVEL:
        return np.zeros_like(roots)
    window = int(fps) | 1
    padded = np.pad(roots, ((window // 2, window // 2), (0, 0)), mode="edge")
    kernel = np.full(window, 1 / window)
    return np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in range(2)], axis=1)
