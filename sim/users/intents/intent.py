"""What every intent can do: become wishes."""

from typing import Protocol

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.easing import smooth_step
from controllers.state import Array
from sim.errors import SimError
from sim.users.wishes import Wishes

PERIOD = 0.02  # [s] between two wishes: shorter than any submovement


class PersonIntent(Protocol):
    """What a person means to do."""

    def wishes(self, curve: Trajectory, seconds: float, seed: int) -> Wishes:
        """What she wants, for a run of so long [s] about a curve; `seed` is of what is left to chance."""
        ...


def moments(seconds: float) -> Array:
    """Times of wishes [s], beyond the run's end: her clock may run up to half as fast again, and she looks ahead."""
    return np.arange(0.0, 1.5 * seconds + 1.0, PERIOD)


def between(t: Array, start: float, end: float) -> Array:
    """0 before `start`, 1 after `end` [s], with least jerk between."""
    eased: list[float] = [smooth_step.py_func(s) for s in np.clip((t - start) / (end - start), 0.0, 1.0)]
    return np.array(eased)


def bump(phase: Array, start: float, end: float) -> Array:
    """0 outside of phases `start` to `end` of a lap, 1 in the middle half of them, with least jerk between."""
    quarter = 0.25 * (end - start)
    return between(phase, start, start + quarter) - between(phase, end - quarter, end)


def centre(curve: Trajectory) -> Array:
    """Middle of a curve [m], shape (3,)."""
    points = curve.point(np.linspace(curve.start, curve.end, 256, endpoint=False))
    return points.mean(axis=0)


def check(intent: object, **numbers: tuple[float, float, float]) -> None:
    """Refuse numbers outside of an interval, given as (value, least, most) by name.

    Raises
    ------
    SimError
        If one is.
    """
    for name, (value, least, most) in numbers.items():
        if not least <= value <= most:
            raise SimError(f"{name} of {type(intent).__name__} is {value}; expected {least:g} to {most:g}")
