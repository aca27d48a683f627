"""The intent to change over to another motion."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, between, centre, check, moments
from sim.users.person.wishes import Wishes, following


@dataclass(frozen=True)
class ChangeOver:
    """Trace the curve and, from a given time on, another one.

    Parameters
    ----------
    to : Trajectory, optional
        The other curve; by default the same curve enlarged, where a cylindrical map blends other clips.
    at, seconds : float
        Start of the change, by default at half the run, and its duration [s].
    """

    to: Trajectory | None = None
    at: float | None = None
    seconds: float = 1.0

    def __post_init__(self) -> None:
        check(self, at=(self.at or 0.0, 0.0, np.inf), seconds=(self.seconds, 0.1, 60.0))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t = moments(seconds)
        at = 0.5 * seconds if self.at is None else self.at
        before, middle = curve.point(curve.start + t), centre(curve)
        after = middle + _ENLARGEMENT * (before - middle) if self.to is None else self.to.point(self.to.start + t)
        share = between(t, at, at + self.seconds)[:, None]
        return Wishes(following((1.0 - share) * before + share * after), PERIOD)


_ENLARGEMENT = 1.35  # factor by which the default curve is enlarged about its centre
