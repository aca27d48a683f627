"""The intent to lead the figure along a path."""

import reprlib
from dataclasses import dataclass

import numpy as np

from controllers.checks import check_kind, numbers_of
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array
from sim.errors import SimError
from sim.users.intents.intent import WISH_PERIOD, moments
from sim.users.person.wishes import Wishes, following


@dataclass(frozen=True)
class Lead:
    """Move along a path, and stay at its end.

    Parameters
    ----------
    points : Array
        Points of the path in H [m], shape (n, 3).
    period : float
        Time between two points [s].

    Raises
    ------
    ParameterError
        If the points or the period are not numbers.
    SimError
        If there is no point, they have another shape or are not finite, or the period is not positive and finite.
    """

    points: Array
    period: float

    def __post_init__(self) -> None:
        points = numbers_of("points", self.points)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not np.all(np.isfinite(points)):
            raise SimError(f"points of Lead are {reprlib.repr(self.points)}; expected rows of three finite numbers")
        check_kind("period", self.period, float)
        if not 0.0 < self.period < np.inf:
            raise SimError(f"period of Lead is {self.period}; expected more than 0 s, and finite")
        object.__setattr__(self, "points", points)

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        times = self.period * np.arange(len(self.points))
        t = moments(seconds)
        points = np.stack([np.interp(t, times, self.points[:, k]) for k in range(3)], axis=1)
        return Wishes(following(points), WISH_PERIOD)
