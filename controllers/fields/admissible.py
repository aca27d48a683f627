"""Admissible speeds along a curve: the smallest and largest at each phase, linear between samples."""

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import numbers_of
from controllers.errors import ParameterError
from geometry.arrays import Array


@njit
def admissible_speeds(params: Array, first: int, rows: int, share: float) -> tuple[float, float]:
    """Smallest and largest admissible speed [m/s].

    Parameters
    ----------
    params : Array
        ``params[first:]`` holds `rows` ≥ 2 pairs, equally spaced from the curve's start to its end.
    first, rows : int
        Index of the first pair in `params`, and number of pairs.
    share : float
        Phase along the curve as a fraction of its duration, 0 to 1.
    """
    position = share * (rows - 1)
    i = min(int(position), rows - 2)
    low, high = first + 2 * i, first + 2 * (i + 1)
    least = params[low] + (position - i) * (params[high] - params[low])
    greatest = params[low + 1] + (position - i) * (params[high + 1] - params[low + 1])
    return least, greatest


def checked_speeds(name: str, values: npt.ArrayLike) -> Array:
    """Pairs of smallest and largest speed [m/s] as an array of shape (m, 2); raises `ParameterError` if malformed."""
    speeds = numbers_of(f"speeds of a {name}", values)
    if speeds.ndim != 2 or speeds.shape[1] != 2 or len(speeds) < 2 or not np.isfinite(speeds).all():
        raise ParameterError(
            f"speeds of a {name} must be finite and of shape (m, 2), m ≥ 2; their shape is {speeds.shape}"
        )
    wrong = (speeds[:, 0] < 0.0) | (speeds[:, 1] < speeds[:, 0])
    if wrong.any():
        at = int(np.argmax(wrong))
        raise ParameterError(f"speeds of a {name} must be 0 ≤ least ≤ greatest; row {at} is {speeds[at]} m/s")
    return speeds
