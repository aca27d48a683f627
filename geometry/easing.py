"""Smooth steps from 0 to 1 used for transitions, quintic (C²) and cubic (C¹), in kernels and on arrays."""

from typing import Any

import numpy as np
from numba import njit

from geometry.arrays import Array


@njit
def smooth_step(x: float) -> float:
    """S(x) = x³ (10 − 15 x + 6 x²) on [0, 1], 0 before and 1 after; C²."""
    x = np.maximum(0.0, np.minimum(1.0, x))
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


@njit
def smooth_step_slope(x: float) -> float:
    """S′(x) = 30 x² (1 − x)² on [0, 1], 0 elsewhere."""
    x = np.maximum(0.0, np.minimum(1.0, x))
    return 30.0 * (x * (1.0 - x)) ** 2


@njit
def cubic_step(x: float) -> float:
    """S₃(x) = x² (3 − 2 x) on [0, 1], 0 before and 1 after; C¹."""
    x = np.maximum(0.0, np.minimum(1.0, x))
    return x * x * (3.0 - 2.0 * x)


def smooth_steps(x: Array) -> Array:
    """S(x) of each element of an array, outside kernels."""
    step: Any = smooth_step.py_func  # the same arithmetic serves numbers and arrays
    return step(x)


def cubic_steps(x: Array) -> Array:
    """S₃(x) of each element of an array, outside kernels."""
    step: Any = cubic_step.py_func
    return step(x)
