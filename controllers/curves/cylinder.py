"""Cylindrical coordinates of the hand about the z axis of H: the angle is the phase, radius and height blend clips."""

import numpy as np
from numba import njit

from controllers.errors import ParameterError
from geometry.arrays import Array

_EASING_FRACTION = 0.15  # fraction of the interval at each edge over which the blend is eased
AXIS = 1e-3  # [m] nearer to the axis, derivatives are evaluated at this distance


@njit
def eased_weight(s: float, margin: float = _EASING_FRACTION) -> tuple[float, float]:
    """Blend weight u(s) and u': 0 below 0, 1 above 1, linear between except for eased edges; C²."""
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0
    slope = 1.0 / (1.0 - margin)
    edge = min(s, 1.0 - s) / margin
    if edge >= 1.0:
        return slope * (s - 0.5 * margin), slope
    # Integral of the smooth step 3x² − 2x³.
    u = slope * margin * (edge**3 - 0.5 * edge**4)
    return (u if s < 0.5 else 1.0 - u), slope * edge * edge * (3.0 - 2.0 * edge)


@njit
def blend_weight(x: float, low: float, high: float, margin: float = _EASING_FRACTION) -> tuple[float, float]:
    """Weight u of the upper end of an interval, 1 − u being that of the lower end, and its derivative by x."""
    u, slope = eased_weight((x - low) / (high - low), margin)
    return u, slope / (high - low)


@njit
def cylinder(x: Array, chain: Array) -> tuple[float, float]:
    """Radius [m] and angle in [0, 2π] of a stylus pose (7,).

    `chain`, shape (3, 6), is written: the derivatives of angle, radius and height by the stylus.
    """
    radius = np.sqrt(x[0] * x[0] + x[1] * x[1])
    angle = np.arctan2(x[1], x[0])
    if angle < 0.0:
        angle = min(angle + 2.0 * np.pi, 2.0 * np.pi)
    inside = max(radius, AXIS)
    chain[:] = 0.0
    chain[0, 0], chain[0, 1] = -x[1] / (inside * inside), x[0] / (inside * inside)
    chain[1, 0], chain[1, 1] = x[0] / inside, x[1] / inside
    chain[2, 2] = 1.0
    return radius, angle


def checked_interval(name: str, interval: tuple[float, float], least: float) -> tuple[float, float]:
    """Validated interval [m], increasing and above `least`; raises `ParameterError`."""
    low, high = interval
    if not (least < low < high < np.inf):
        raise ParameterError(f"{name} must increase{' from 1 mm or more' * (least > 0.0)}, got {low, high} m")
    return low, high
