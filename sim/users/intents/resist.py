"""The intent to resist the field for some time."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, check, moments
from sim.users.person.wishes import GRIP, PLACE, Wishes, following


@dataclass(frozen=True)
class Resist:
    """Trace the curve, but stay at one place of it for some time, with a firm grip, against the field; then go on.

    Parameters
    ----------
    at, seconds : float
        Start and duration of the stay [s].
    grip : float
        Grip force during the stay [N].
    """

    at: float = 3.0
    seconds: float = 3.0
    grip: float = 8.0

    def __post_init__(self) -> None:
        check(self, at=(self.at, 0.0, np.inf), seconds=(self.seconds, 0.1, np.inf), grip=(self.grip, 0.5, 10.0))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t = moments(seconds)
        stays = (t >= self.at) & (t < self.at + self.seconds)
        own = t - np.clip(t - self.at, 0.0, self.seconds)
        rows = following(curve.point(curve.start + own))
        rows[stays, PLACE : PLACE + 3] = curve.point(curve.start + self.at)
        rows[stays, GRIP] = self.grip
        return Wishes(rows, PERIOD)
