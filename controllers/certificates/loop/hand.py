"""Hand model of the certificates: a mechanical impedance on the stylus, and intervals of impedances."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from controllers.checks import check_field_types
from controllers.errors import ParameterError
from geometry.arrays import Array

MAX_STIFFNESS, MAX_DAMPING = 1e6, 1e4
"""[N/m], [N s/m]: beyond any device, and beyond any hand."""


_MAX_MASS = 1e3  # [kg] more than any hand, and small enough for accurate eigenvalues of the loop


@dataclass(frozen=True)
class HandImpedance:
    """Hand on the stylus tip: F = −m v̇ − b (v − v_d) − k (p − p_d), about its own intended motion (p_d, v_d).

    Parameters
    ----------
    mass, damping, stiffness : float
        m [kg], b [N s/m], k [N/m]; all zero means no hand.

    Raises
    ------
    ParameterError
        If one is negative, not finite, or larger than that of any hand.
    """

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        for name, limit in (("mass", _MAX_MASS), ("damping", MAX_DAMPING), ("stiffness", MAX_STIFFNESS)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ParameterError(f"{name} of a hand must be finite and at least 0, got {value}")
            if value > limit:
                raise ParameterError(f"{name} of a hand must be at most {limit:g}, got {value:g}")

    def __str__(self) -> str:
        """Description with units."""
        if self == NO_HAND:
            return "no hand"
        return f"a hand of {self.mass:g} kg, {self.damping:g} N s/m, {self.stiffness:g} N/m"

    def numbers(self) -> Array:
        """[m, b, k]."""
        return np.array([self.mass, self.damping, self.stiffness])


NO_HAND = HandImpedance()


@dataclass(frozen=True)
class HandRange:
    """Impedance intervals of the hands that may hold the stylus.

    Parameters
    ----------
    mass : two floats
        Smallest and largest m [kg].
    damping : two floats
        Smallest and largest b [N s/m].
    stiffness : two floats
        Smallest and largest k [N/m].
    """

    mass: tuple[float, float] = (0.0, 0.3)
    damping: tuple[float, float] = (0.0, 8.0)
    stiffness: tuple[float, float] = (0.0, 500.0)

    def __post_init__(self) -> None:
        check_field_types(self)

    def hands(self) -> list[HandImpedance]:
        """No hand, the corners and the middle.

        Raises
        ------
        ParameterError
            If an interval ends before it begins, or a number is negative or not finite.
        """
        for name in ("mass", "damping", "stiffness"):
            low, high = getattr(self, name)
            if low > high:
                raise ParameterError(
                    f"{name} of hands lies between {low} and {high}; expected the smaller number first"
                )
        corners = [HandImpedance(*c) for c in itertools.product(self.mass, self.damping, self.stiffness)]
        middle = HandImpedance(*(0.5 * (low + high) for low, high in (self.mass, self.damping, self.stiffness)))
        return list(dict.fromkeys([NO_HAND, *corners, middle]))


NO_HANDS = HandRange((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
