"""The intent of a person who loses the curve and comes back to it."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import PERIOD, check, moments
from sim.users.person.wishes import ENGAGED, Wishes, following


@dataclass(frozen=True)
class GetLost:
    """Trace the curve, lose it, wander about, and come back.

    Parameters
    ----------
    at, seconds : float
        Start and duration of the wandering [s].
    away : float
        Size of the wandering [m], as a standard deviation along each axis.
    """

    at: float = 3.0
    seconds: float = 4.0
    away: float = 0.01

    def __post_init__(self) -> None:
        check(self, at=(self.at, 0.0, np.inf), seconds=(self.seconds, 0.5, np.inf), away=(self.away, 0.0, 0.05))

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, rng = moments(seconds), np.random.default_rng([seed, _RANDOM_STREAM])
        progress = np.clip((t - self.at) / self.seconds, 0.0, 1.0)
        size = np.sin(np.pi * progress) ** 2
        waves = 2.0 * np.pi * _FREQUENCIES * (t - self.at)[:, None]
        turns = rng.uniform(0.0, 2.0 * np.pi, (3, len(_FREQUENCIES)))
        wander = np.sqrt(2.0 / len(_FREQUENCIES)) * np.stack(
            [np.cos(waves + turn).sum(axis=1) for turn in turns], axis=1
        )
        rows = following(curve.point(curve.start + t) + self.away * size[:, None] * wander)
        # In the middle she is passive for a moment.
        rows[(progress > 0.45) & (progress < 0.55), ENGAGED] = 0.0
        return Wishes(rows, PERIOD)


_FREQUENCIES = np.array([0.23, 0.41, 0.67])  # [Hz] without a short common period
_RANDOM_STREAM = 20  # number of this random stream under a run's seed
