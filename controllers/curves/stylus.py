"""Stylus poses with the stylus upright."""

import numpy as np

from controllers.state import Array

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the stylus along the default curve."""


def stylus_path(points: Array) -> Array:
    """Stylus poses at points of H with the stylus upright, shape (n, 3) → (n, 7)."""
    return np.hstack((points, np.tile(UPRIGHT, (len(points), 1))))
