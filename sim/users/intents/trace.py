"""The intent to trace the curve."""

from dataclasses import dataclass

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, check, moments
from sim.users.person.wishes import Wishes, following


@dataclass(frozen=True)
class Trace:
    """Trace the curve actively, lap after lap.

    Parameters
    ----------
    tempo : float
        Factor on the curve's own speed.
    """

    tempo: float = 1.0

    def __post_init__(self) -> None:
        check(self, tempo=(self.tempo, 0.1, 10.0))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        points = curve.point(curve.start + self.tempo * moments(seconds))
        return Wishes(following(points), PERIOD, curve.duration / self.tempo)
