"""Workspace limits of authored curves: region, distances, speed and acceleration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from controllers.checks import check_field_types, checked
from controllers.curves.cylinder import checked_interval
from controllers.errors import ParameterError
from geometry.arrays import Array


class Rectangle(NamedTuple):
    """Region of the sites [m]: r from r_min to r_max, z from z_min to z_max."""

    r_min: float
    r_max: float
    z_min: float
    z_max: float

    @property
    def low(self) -> Array:
        """(r_min, z_min)."""
        return np.array([self.r_min, self.z_min])

    @property
    def high(self) -> Array:
        """(r_max, z_max)."""
        return np.array([self.r_max, self.z_max])


@dataclass(frozen=True)
class Room:
    """Limits of authored curves: their region, their distances, and the hand's speed and acceleration on them.

    Parameters
    ----------
    r_range : tuple of two floats
        Least and greatest distance from the z axis of H [m].
    z_range : tuple of two floats
        Least and greatest height in H [m].
    separation : float
        Least distance of two curves at one angle, away from their transitions [m].
    approach : float
        Distance of two curves at a transition where poses agree [m].
    alike : float
        Relative mismatch of poses, velocities and standing feet up to which two motions have a transition [1].
    speed : float
        Largest speed of a hand that follows a curve at its clip's pace [m/s].
    acceleration : float
        Its largest acceleration [m/s²].

    Raises
    ------
    ParameterError
        If an interval is empty, a number is not positive and finite, or the approach exceeds the separation.
    """

    r_range: tuple[float, float] = (0.04, 0.072)
    z_range: tuple[float, float] = (-0.05, 0.05)
    separation: float = 0.01
    approach: float = 0.002
    alike: float = 0.55
    speed: float = 1.0
    acceleration: float = 8.0

    def __post_init__(self) -> None:
        check_field_types(self)
        checked_interval("r_range", self.r_range, 1e-3)
        checked_interval("z_range", self.z_range, -np.inf)
        checked("alike", self.alike, "", least=0.0)
        for name, unit in (("separation", "m"), ("approach", "m"), ("speed", "m/s"), ("acceleration", "m/s²")):
            checked(name, getattr(self, name), unit, least=5e-4)
        if self.approach > self.separation:
            raise ParameterError(
                f"the approach at transitions is {1e3 * self.approach:g} mm, more than the separation elsewhere, "
                f"{1e3 * self.separation:g} mm; expected less"
            )

    @property
    def rectangle(self) -> Rectangle:
        """The region as a `Rectangle`."""
        return Rectangle(*self.r_range, *self.z_range)
