"""Intents that are given by what the hand is to do: pushes, grabs, or points of a path."""

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.checks import check_field_types, check_kind, numbers_of
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array
from sim.errors import SimError
from sim.users.hand.actions import Grab, Push, grab_table
from sim.users.intents.intent import WISH_PERIOD, between, centre, moments
from sim.users.person.wishes import ENGAGED, FORCE, PLACE, SWITCH, Wishes, following, resting


@dataclass(frozen=True)
class Press:
    """Be led by the field, and push the stylus at given times with an additional force.

    Parameters
    ----------
    pushes : sequence of Push
        Pushes without a place; those without a direction are directed away from the curve's centre.

    Raises
    ------
    SimError
        If there is no push, or one has a place.
    """

    pushes: Sequence[Push]

    def __post_init__(self) -> None:
        check_field_types(self)
        if len(self.pushes) == 0:
            raise SimError("a person who pushes has no pushes; expected one or more")
        if any(push.place is not None for push in self.pushes):
            raise SimError("a person's push has a position; expected a time and a direction")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, middle = moments(seconds), centre(curve)
        rows = resting(len(t))
        outward = curve.point(curve.start + t) - middle
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        for push in self.pushes:
            phase = np.clip((t - push.at) / push.seconds, 0.0, 1.0)
            direction = outward if push.direction is None else np.array(push.direction) / np.linalg.norm(push.direction)
            rows[:, FORCE : FORCE + 3] += (push.force * np.sin(np.pi * phase) ** 2)[:, None] * direction
        return Wishes(rows, WISH_PERIOD, curve.duration)


@dataclass(frozen=True)
class Bend:
    """Grab the curve with the switch at given places, carry it, release it; in between be led by the field.

    Parameters
    ----------
    grabs : sequence of Grab
        Each must have a place.

    Raises
    ------
    SimError
        If there is no grab, grabs overlap, or one has no place, since a person decides where she grabs the curve.
    """

    grabs: Sequence[Grab]

    def __post_init__(self) -> None:
        check_field_types(self)
        if len(self.grabs) == 0:
            raise SimError("a person who bends a curve has no grabs; expected one or more")
        grab_table(self.grabs)
        if any(grab.place is None for grab in self.grabs):
            raise SimError("a person's grab has no position; expected where it takes hold, in H [m]")

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """See `PersonIntent`."""
        t, grabs = moments(seconds), sorted(self.grabs, key=lambda grab: grab.at)
        rows = resting(len(t))
        # A person plans ahead of her clock, by the place's velocity and acceleration: it moves smoothly all the time.
        left, place = 0.0, np.array(grabs[0].place)
        path = np.tile(place, (len(t), 1))
        for grab in grabs:
            grip_start, reached, carry = grab.at + grab.reach, np.array(grab.place), np.array(grab.carry)
            arrived = between(t, left, max(grab.at, left + grab.reach))
            carried = between(t, grip_start, grip_start + grab.seconds)
            path += arrived[:, None] * (reached - place) + carried[:, None] * carry
            is_busy = (t >= grab.at) & (t < grab.end)
            rows[is_busy, ENGAGED] = 1.0
            rows[is_busy & (t >= grip_start), SWITCH] = 1.0
            left, place = grab.end, reached + carry
        rows[:, PLACE : PLACE + 3] = path
        return Wishes(rows, WISH_PERIOD)


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
