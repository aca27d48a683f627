"""The intent to cut a corner of the curve."""

from dataclasses import dataclass

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, check, moments
from sim.users.person.wishes import Wishes, following


@dataclass(frozen=True)
class CutCorner:
    """Trace the curve, with one part replaced by a straight line.

    Parameters
    ----------
    start, end : float
        Phases of the lap at the ends of the line, 0 to 1.
    """

    start: float = 0.3
    end: float = 0.55

    def __post_init__(self) -> None:
        check(self, start=(self.start, 0.0, 1.0))
        check(self, end=(self.end, self.start + 1e-3, 1.0))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t = moments(seconds)
        points, phase = curve.point(curve.start + t), (t / curve.duration) % 1.0
        first, last = (curve.point(curve.start + at * curve.duration) for at in (self.start, self.end))
        cut = (phase > self.start) & (phase < self.end)
        share = ((phase[cut] - self.start) / (self.end - self.start))[:, None]
        points[cut] = (1.0 - share) * first + share * last
        return Wishes(following(points), PERIOD, curve.duration)
