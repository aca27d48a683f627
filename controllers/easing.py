"""The quintic smooth step used by the kernels for transitions."""

import numpy as np
from numba import njit


@njit
def smooth_step(x: float) -> float:
    """S(x) = x³ (10 − 15 x + 6 x²) on [0, 1], 0 before and 1 after; C²."""
    x = np.maximum(0.0, np.minimum(1.0, x))
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))
