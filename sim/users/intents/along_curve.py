"""Intents of a person on the curve: let it lead her, trace it or part of it, leave it and come back."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from sim.users.intents.intent import WISH_PERIOD, between, bump, centre, check, moments
from sim.users.person.wishes import ENGAGED, GRIP, Wishes, following, resting


@dataclass(frozen=True)
class Relax:
    """Hold the stylus and be led: the arm is slack, and its rest position follows the hand."""

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        return Wishes(resting(len(moments(seconds))), WISH_PERIOD, curve.duration)


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
        return Wishes(following(points), WISH_PERIOD, curve.duration / self.tempo)


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
        return Wishes(following(points), WISH_PERIOD, curve.duration)


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
        return Wishes(following(points), WISH_PERIOD, curve.duration)


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
        return Wishes(following((1.0 - share) * before + share * after), WISH_PERIOD)


_ENLARGEMENT = 1.35  # factor by which the default curve is enlarged about its centre


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
        return Wishes(rows, WISH_PERIOD)


_FREQUENCIES = np.array([0.23, 0.41, 0.67])  # [Hz] without a short common period
_RANDOM_STREAM = 20  # number of this random stream under a run's seed


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
        rows = following(curve.point(curve.start + np.minimum(t, np.maximum(self.at, t - self.seconds))))
        rows[is_staying, GRIP] = self.grip
        return Wishes(rows, WISH_PERIOD)
