"""The quintic smooth step used for transitions, in kernels and on arrays."""

from typing import Any

import numpy as np
from numba import njit

from controllers.state import Array


@njit
def smooth_step(x: float) -> float:
    """S(x) = x³ (10 − 15 x + 6 x²) on [0, 1], 0 before and 1 after; C²."""
    x = np.maximum(0.0, np.minimum(1.0, x))
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


def smooth_steps(x: Array) -> Array:
    """S(x) of each element of an array, outside kernels."""
    step: Any = smooth_step.py_func  # the same arithmetic serves numbers and arrays
    return step(x)
