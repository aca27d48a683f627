"""Scripted actions of a simulated arm at the stylus: pushes, grabs with the switch pressed, and turns of the stylus."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from controllers.checks import check_field_types
from sim.errors import SimError

Records = npt.NDArray[Any]
"""Actions for the compiled hand, shape (n,), which reads their fields by name: times [s], forces [N], places [m]."""

# With outward 1 a push has no direction of its own, with a radius of 0 it begins at any place.
_PUSH = np.dtype([
    ("start", "f8"), ("duration", "f8"), ("peak", "f8"), ("direction", "f8", 3), ("outward", "f8"), ("place", "f8", 3),
    ("radius", "f8"),
])  # fmt: skip
GRAB = np.dtype([
    ("start", "f8"), ("reach", "f8"), ("place", "f8", 3), ("carry", "f8", 3), ("duration", "f8"), ("hold", "f8"),
    ("steady", "f8"),
])  # fmt: skip
"""A grab for the compiled hand; a place of NaN is the hand's own position, and steady is 0 or 1."""
_TURN = np.dtype([("start", "f8"), ("duration", "f8"), ("peak", "f8", 3)])


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
        if not np.all(np.isfinite(np.array(numbers, dtype=float))):
            raise SimError(f"a push has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.at < 0.0 or self.radius <= 0.0:
            raise SimError(f"a push needs at ≥ 0 s, seconds > 0 and radius > 0 m, got {self}")
        if self.direction is not None and np.linalg.norm(self.direction) < 1e-12:
            raise SimError(f"the direction of a push has no length: {self.direction}")

    def record(self) -> tuple[object, ...]:
        """The push for the compiled hand."""
        direction = np.zeros(3) if self.direction is None else np.array(self.direction) / np.linalg.norm(self.direction)
        place, radius = (np.zeros(3), 0.0) if self.place is None else (np.array(self.place), self.radius)
        return self.at, self.seconds, self.force, direction, self.direction is None, place, radius


def push_table(pushes: Sequence[Push]) -> Records:
    """All pushes for the compiled hand."""
    return np.array([push.record() for push in pushes], _PUSH)


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
        if not np.all(np.isfinite(np.array(numbers, dtype=float))):
            raise SimError(f"a grab has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.reach <= 0.0 or self.at < 0.0 or self.hold < 0.0:
            raise SimError(f"a grab needs seconds and reach > 0, at and hold ≥ 0 s, got {self}")

    @property
    def end(self) -> float:
        """Time at which the switch is released [s]."""
        return self.at + (0.0 if self.place is None else self.reach) + self.seconds + self.hold

    def record(self) -> tuple[object, ...]:
        """The grab for the compiled hand, a `GRAB`."""
        place, reach = (np.full(3, np.nan), 0.0) if self.place is None else (self.place, self.reach)
        return self.at, reach, place, self.carry, self.seconds, self.hold, self.steady


def grab_table(grabs: Sequence[Grab]) -> Records:
    """All grabs for the compiled hand, by starting time.

    Raises
    ------
    SimError
        If grabs overlap.
    """
    ordered = sorted(grabs, key=lambda grab: grab.at)
    for before, after in itertools.pairwise(ordered):
        if after.at < before.end:
            raise SimError(f"a grab begins at {after.at:g} s, before another has ended at {before.end:g} s")
    return np.array([grab.record() for grab in ordered], GRAB)


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
        if not np.all(np.isfinite(np.array([self.at, self.seconds, self.angle, *self.axis], dtype=float))):
            raise SimError(f"a turn has a number that is not finite: {self}")
        if self.seconds <= 0.0 or self.at < 0.0 or abs(self.angle) > np.pi:
            raise SimError(f"a turn needs at ≥ 0 s, seconds > 0 and an angle within ±π, got {self}")
        if np.linalg.norm(self.axis) < 1e-12:
            raise SimError(f"the axis of a turn has no length: {self.axis}")

    def record(self) -> tuple[object, ...]:
        """The turn for the compiled hand: times [s], and the rotation vector at its peak [rad]."""
        return self.at, self.seconds, self.angle * np.array(self.axis) / np.linalg.norm(self.axis)


def turn_table(turns: Sequence[Turn]) -> Records:
    """All turns for the compiled hand."""
    return np.array([turn.record() for turn in turns], _TURN)
