"""Scripted actions of a simulated arm at the stylus: pushes, grabs with the switch pressed, and turns of the stylus."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types
from geometry.arrays import Array
from sim.errors import SimError

_PUSH_COLUMNS, _TURN_COLUMNS = 11, 5
GRAB_COLUMNS = 11
"""Columns of a `grab_table`."""


def _values(vector: Sequence[float] | None) -> Sequence[float]:
    return () if vector is None else vector


@dataclass(frozen=True)
class Push:
    r"""A push of the hand: a smooth bump of force in one direction.

    .. math:: F(t) = F_{max} \sin^2(\pi (t - t_0) / T)\, d, \qquad t_0 \le t \le t_0 + T

    Parameters
    ----------
    at : float
        Earliest time [s].
    seconds : float
        T [s].
    force : float
        Largest force [N]; negative pushes the other way.
    direction : tuple of float, optional
        Fixed direction d in the hand frame, any length but zero. By default horizontally away from the vertical axis of
        the hand frame, wherever the hand is.
    place : tuple of float, optional
        Point in the hand frame [m]: the push begins when the hand first comes within `radius` of it after `at`.
    radius : float
        Radius around `place` [m].

    Raises
    ------
    SimError
        If a number is outside its interval or the direction has no length.
    ParameterError
        If a value is of another kind.
    """

    at: float
    seconds: float
    force: float
    direction: tuple[float, float, float] | None = None
    place: tuple[float, float, float] | None = None
    radius: float = 0.01

    def __post_init__(self) -> None:
        check_field_types(self)
        numbers = [self.at, self.seconds, self.force, self.radius, *_values(self.direction), *_values(self.place)]
        if not np.all(np.isfinite(numbers)):
            raise SimError(f"a push has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.at < 0.0 or self.radius <= 0.0:
            raise SimError(f"a push needs at ≥ 0 s, seconds > 0 and radius > 0 m, got {self}")
        if self.direction is not None and np.linalg.norm(self.direction) < 1e-12:
            raise SimError(f"the direction of a push has no length: {self.direction}")

    def row(self) -> Array:
        """The push as numbers for the compiled hand, shape (11,)."""
        direction = np.zeros(3) if self.direction is None else np.array(self.direction) / np.linalg.norm(self.direction)
        place, radius = (np.zeros(3), 0.0) if self.place is None else (np.array(self.place), self.radius)
        outward = float(self.direction is None)
        return np.array([self.at, self.seconds, self.force, *direction, outward, *place, radius])


def push_table(pushes: Sequence[Push]) -> Array:
    """Rows of all pushes for `push_at`, shape (n, 11)."""
    return np.array([push.row() for push in pushes]).reshape(len(pushes), _PUSH_COLUMNS)


class PushRow(NamedTuple):
    """A `Push` in compiled code: times [s], peak [N], place and radius [m]; a radius of 0 means any place."""

    start: float
    duration: float
    peak: float
    direction: Array
    outward: float
    place: Array
    radius: float


@njit
def push_at(pushes: Array, i: int) -> PushRow:
    """Push i of a `push_table`."""
    row = pushes[i]
    return PushRow(row[0], row[1], row[2], row[3:6], row[6], row[7:10], row[10])


@dataclass(frozen=True)
class Grab:
    r"""Go to a place, press the switch, carry the stylus along a vector, hold, and release stylus and switch.

    .. math:: p_d(t) = a + \sigma(t)\,(b - a), \qquad \sigma(s) = 10 s^3 - 15 s^4 + 6 s^5

    The intended position p_d moves with minimum jerk from the hand's position at the start of the grab to the place
    within `reach`, and from there, with the switch pressed, along `carry` within `seconds`; it then stays for `hold`.
    The stylus is pulled by the arm's impedance (see `sim.users.hand.arm`), so it lags behind p_d where a force resists.

    Parameters
    ----------
    at : float
        Start of the grab [s].
    carry : tuple of float
        Displacement in the hand frame [m]; zero for a mere click.
    seconds : float
        Duration of the displacement [s].
    hold : float
        Time that the hand stays at the end with the switch pressed [s].
    place : tuple of float, optional
        Point at which the switch is pressed, in the hand frame [m]; by default the hand's position.
    reach : float
        Time to get there [s]; ignored without a place.
    steady : bool
        Carry at constant speed, σ(s) = s: the stylus is grabbed and released in motion.

    Raises
    ------
    SimError
        If a number is out of its interval.
    ParameterError
        If a value is of another kind.
    """

    at: float
    carry: tuple[float, float, float]
    seconds: float = 1.0
    hold: float = 0.3
    place: tuple[float, float, float] | None = None
    reach: float = 1.0
    steady: bool = False

    def __post_init__(self) -> None:
        check_field_types(self)
        numbers = [self.at, self.seconds, self.hold, self.reach, *self.carry, *_values(self.place)]
        if not np.all(np.isfinite(numbers)):
            raise SimError(f"a grab has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.reach <= 0.0 or self.at < 0.0 or self.hold < 0.0:
            raise SimError(f"a grab needs seconds and reach > 0, at and hold ≥ 0 s, got {self}")

    @property
    def end(self) -> float:
        """Time at which the switch is released [s]."""
        return self.at + (0.0 if self.place is None else self.reach) + self.seconds + self.hold

    def row(self) -> Array:
        """The grab as numbers for the compiled hand, shape (11,)."""
        place, reach = (np.full(3, np.nan), 0.0) if self.place is None else (np.array(self.place), self.reach)
        return np.array([self.at, reach, *place, *self.carry, self.seconds, self.hold, float(self.steady)])


def grab_table(grabs: Sequence[Grab]) -> Array:
    """Rows of all grabs for `grab_at`, by starting time, shape (n, 11).

    Raises
    ------
    SimError
        If grabs overlap.
    """
    ordered = sorted(grabs, key=lambda grab: grab.at)
    for before, after in itertools.pairwise(ordered):
        if after.at < before.end:
            raise SimError(f"a grab begins at {after.at:g} s, before another has ended at {before.end:g} s")
    return np.array([grab.row() for grab in ordered]).reshape(len(ordered), GRAB_COLUMNS)


class GrabRow(NamedTuple):
    """A `Grab` in compiled code: times [s], place (NaN: the hand's position) and carry [m]; steady is 0 or 1."""

    start: float
    reach: float
    place: Array
    carry: Array
    duration: float
    hold: float
    steady: float


@njit
def grab_at(grabs: Array, i: int) -> GrabRow:
    """Grab i of a `grab_table`."""
    row = grabs[i]
    return GrabRow(row[0], row[1], row[2:5], row[5:8], row[8], row[9], row[10])


@dataclass(frozen=True)
class Turn:
    r"""Turn the stylus about an axis and back; between turns the intended orientation is upright.

    .. math:: R_d(t) = \exp\bigl(\textstyle\sum_i \alpha_i \sin^2(\pi (t - t_i) / T_i)\, n_i\bigr)

    Parameters
    ----------
    at : float
        t_i [s].
    seconds : float
        T_i, duration of turning there and back [s].
    angle : float
        α_i, the peak angle [rad]; at most half a turn either way.
    axis : tuple of float
        n_i in the hand frame, any length but zero: x rolls the pen, y points it down, z points it to the left.

    Raises
    ------
    SimError
        If a number is out of its interval or the axis has no length.
    ParameterError
        If a value is of another kind.
    """

    at: float
    seconds: float
    angle: float
    axis: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_field_types(self)
        if not np.all(np.isfinite([self.at, self.seconds, self.angle, *self.axis])):
            raise SimError(f"a turn has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.at < 0.0 or abs(self.angle) > np.pi:
            raise SimError(f"a turn needs at ≥ 0 s, seconds > 0 and an angle within ±π, got {self}")
        if np.linalg.norm(self.axis) < 1e-12:
            raise SimError(f"the axis of a turn has no length: {self.axis}")

    def row(self) -> Array:
        """The turn as numbers for the compiled hand, shape (5,)."""
        return np.array([self.at, self.seconds, *(self.angle * np.array(self.axis) / np.linalg.norm(self.axis))])


def turn_table(turns: Sequence[Turn]) -> Array:
    """Rows of all turns for `turn_at`, shape (n, 5)."""
    return np.array([turn.row() for turn in turns]).reshape(len(turns), _TURN_COLUMNS)


class TurnRow(NamedTuple):
    """A `Turn` in compiled code: times [s], and the rotation vector at its peak [rad]."""

    start: float
    duration: float
    peak: Array


@njit
def turn_at(turns: Array, i: int) -> TurnRow:
    """Turn i of a `turn_table`."""
    row = turns[i]
    return TurnRow(row[0], row[1], row[2:5])
