"""The room that authored curves have in the device's workspace."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from controllers.checks import checked
from controllers.curves.cylinder import checked_interval
from controllers.errors import ParameterError
from controllers.state import Array


class Rectangle(NamedTuple):
    """Where sites may be [m]: r from r_min to r_max, z from z_min to z_max."""

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
    """Where curves may be, and how near to each other and how fast.

    Parameters
    ----------
    r_range : tuple of two floats
        Least and greatest distance from the z axis of H [m].
    z_range : tuple of two floats
        Least and greatest height in H [m].
    separation : float
        Least distance of two curves at one angle, away from their transitions [m].
    approach : float
        How near they come at a transition where poses agree [m].
    alike : float
        Relative mismatch of poses, velocities and standing feet up to which two motions have a transition [1].
    speed : float
        Greatest of a hand that follows a curve at its clip's pace [m/s].
    acceleration : float
        Likewise [m/s²].

    Raises
    ------
    ParameterError
        If an interval is empty, a number is not positive and finite, or the approach exceeds the separation.
    """

    r_range: tuple[float, float] = (0.02, 0.072)
    z_range: tuple[float, float] = (-0.05, 0.05)
    separation: float = 0.01
    approach: float = 0.002
    alike: float = 0.55
    speed: float = 1.0
    acceleration: float = 8.0

    def __post_init__(self) -> None:
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
        """r_min, r_max, z_min, z_max."""
        return Rectangle(*self.r_range, *self.z_range)
