"""The intent to lead the figure along a path."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.state import Array
from sim.users.intents.intent import PERIOD, moments
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
    """

    points: Array
    period: float

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        given = self.period * np.arange(len(self.points))
        t = moments(seconds)
        points = np.stack([np.interp(t, given, self.points[:, k]) for k in range(3)], axis=1)
        return Wishes(following(points), PERIOD)
