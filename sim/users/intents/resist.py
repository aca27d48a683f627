"""The intent to resist the field for some time."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, check, moments
from sim.users.person.wishes import GRIP, PLACE, Wishes, following


@dataclass(frozen=True)
class Resist:
    """Trace the curve, but hold one place on it for some time against the field, with a firm grip; then go on.

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
        is_staying = (t >= self.at) & (t < self.at + self.seconds)
        curve_time = t - np.clip(t - self.at, 0.0, self.seconds)
        rows = following(curve.point(curve.start + curve_time))
        rows[is_staying, PLACE : PLACE + 3] = curve.point(curve.start + self.at)
        rows[is_staying, GRIP] = self.grip
        return Wishes(rows, PERIOD)
