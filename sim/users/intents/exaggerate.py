"""The intent to exaggerate one part of a motion and to calm another."""

from dataclasses import dataclass

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, bump, centre, check, moments
from sim.users.person.wishes import Wishes, following


@dataclass(frozen=True)
class Exaggerate:
    """Trace the curve, further from its centre where the motion is to be larger, closer where it is to be calmer.

    Parameters
    ----------
    larger, calmer : float
        Factors on the distance from the curve's centre.
    where, there : tuple of (float, float)
        First and last phase of the lap for `larger` and for `calmer`, 0 to 1.
    """

    larger: float = 1.3
    calmer: float = 0.7
    where: tuple[float, float] = (0.05, 0.45)
    there: tuple[float, float] = (0.55, 0.95)

    def __post_init__(self) -> None:
        check(self, larger=(self.larger, 1.0, 3.0), calmer=(self.calmer, 0.0, 1.0))
        for start, end in (self.where, self.there):
            check(self, start=(start, 0.0, 1.0), end=(end, start + 1e-3, 1.0))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, middle = moments(seconds), centre(curve)
        phase = (t / curve.duration) % 1.0
        size = 1.0 + (self.larger - 1.0) * bump(phase, *self.where) + (self.calmer - 1.0) * bump(phase, *self.there)
        points = middle + size[:, None] * (curve.point(curve.start + t) - middle)
        return Wishes(following(points), PERIOD, curve.duration)
