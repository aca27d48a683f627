"""The interface of an intent, conversion to wishes, and helpers shared by the intents."""

from typing import Protocol, runtime_checkable

import numpy as np

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array
from geometry.easing import smooth_steps
from sim.errors import SimError
from sim.users.person.wishes import Wishes

WISH_PERIOD = 0.02  # [s] sampling period of wishes: shorter than any submovement


@runtime_checkable
class PersonIntent(Protocol):
    """What a person intends to do."""

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """Her wishes for a run of `seconds` on a curve; `seed` is for intents with random parts."""
        ...


def moments(seconds: float) -> Array:
    """Times of wishes [s], beyond the end of the run: her clock may run 1.5 times as fast, and she plans ahead."""
    return np.arange(0.0, 1.5 * seconds + 1.0, WISH_PERIOD)


def between(t: Array, start: float, end: float) -> Array:
    """0 before `start`, 1 after `end` [s], a minimum-jerk profile between."""
    return smooth_steps((t - start) / (end - start))


def bump(phase: Array, start: float, end: float) -> Array:
    """0 outside of the phases `start` to `end` of a lap, 1 in the middle half, minimum-jerk profiles between."""
    quarter = 0.25 * (end - start)
    return between(phase, start, start + quarter) - between(phase, end - quarter, end)


def centre(curve: Trajectory) -> Array:
    """Centre of a curve, the mean of its points [m], shape (3,)."""
    points = curve.point(np.linspace(curve.start, curve.end, 256, endpoint=False))
    return points.mean(axis=0)


def check(intent: object, **numbers: tuple[float, float, float]) -> None:
    """Check the kinds of all values of an intent, and its finite numbers, given by name as (value, min, max).

    Raises
    ------
    ParameterError
        If a value is of another kind.
    SimError
        If a number is outside its interval.
    """
    check_field_types(intent)
    for name, (value, least, most) in numbers.items():
        if not least <= value <= most or np.isinf(value):
            expected = f"{least:g} to {most:g}" if most < np.inf else f"{least:g} or more, and finite"
            raise SimError(f"{name} of {type(intent).__name__} is {value}; expected {expected}")
