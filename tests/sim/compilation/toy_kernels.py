"""Kernels for the tests of units, so small that they compile quickly."""

from typing import NamedTuple

from numba import njit

GAIN = 2.0


class Spring(NamedTuple):
    """A named tuple, as kernels take them."""

    stiffness: float
    rest: float


@njit
def stretch(spring: Spring, x: float) -> float:
    """How far."""
    return x - spring.rest


@njit
def force(spring: Spring, x: float, out: list[float]) -> None:
    """Calls another function and names a constant."""
    out[0] = GAIN * spring.stiffness * stretch(spring, x)


@njit
def other(x: float, out: list[float]) -> None:
    """Reaches nothing of the others."""
    out[0] = x + 1.0
