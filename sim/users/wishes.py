"""What a person wants from one moment to the next: the table that an intent becomes, and how it is read."""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from controllers.state import Array
from sim.errors import SimError

PLACE, FORCE, GRIP, WIDTH, SWITCH, ENGAGED, WISH_SIZE = 0, 3, 6, 7, 8, 9, 10
"""Columns of a wish: place (3) [m] and force (3) [N] in H, grip [N] or NaN for the person's own, width of a target [m],
switch, and whether the person does anything; without, she lets the stylus go where it goes."""
OWN = -1.0
"""Period of wishes that an intent of the caller's own writes."""


@dataclass(frozen=True)
class Wishes:
    """Wishes of a person, either by time or one target after the other.

    Parameters
    ----------
    rows : Array
        Wishes, shape (n, 10), columns as above.
    period : float
        Time between two rows [s]; 0 where each row is a target, and the next one's turn comes when it is reached;
        negative where an intent of the caller's own writes the two rows (see `sim.users.own_intent`).
    lap : float
        Time after which the wish repeats itself, for what is learned from one repetition to the next [s]; 0: never.

    Raises
    ------
    SimError
        If the table has another shape, no row, or a number that is not finite.
    """

    rows: Array = field(default_factory=lambda: resting(1))
    period: float = 0.02
    lap: float = 0.0

    def __post_init__(self) -> None:
        rows = self.rows
        if rows.ndim != 2 or rows.shape[1] != WISH_SIZE or len(rows) < 1:
            raise SimError(f"wishes of shape {rows.shape}; expected (n, {WISH_SIZE}), n ≥ 1")
        if not np.all(np.isfinite(np.delete(rows, GRIP, axis=1))) or np.any(np.isinf(rows[:, GRIP])):
            raise SimError("wishes have a number that is not finite; expected finite ones, but for the grip")
        if not (np.isfinite(self.period) and self.lap >= 0.0 and np.isfinite(self.lap)):
            raise SimError(f"wishes {self.period} s apart, repeated after {self.lap} s; expected finite, 0 s or more")
        if self.period == 0.0 and np.any(rows[:, WIDTH] <= 0.0):
            raise SimError("a target has no width; expected more than 0 m")


def resting(n: int) -> Array:
    """Wishes of a person who does nothing, shape (n, 10)."""
    rows = np.zeros((n, WISH_SIZE))
    rows[:, GRIP] = np.nan
    return rows


def following(points: Array) -> Array:
    """Wishes of a person who follows points (n, 3) of H, shape (n, 10)."""
    rows = resting(len(points))
    rows[:, PLACE : PLACE + 3], rows[:, ENGAGED] = points, 1.0
    return rows


def targets(points: Array, width: float) -> Wishes:
    """Targets (n, 3) of a width [m] across the way from the last one, one after the other; each is clicked."""
    rows = following(points)
    rows[:, WIDTH] = width
    return Wishes(rows, period=0.0)


@njit
def wanted_motion(rows: Array, period: float, t: float, motion: Array) -> int:
    """Set the motion (position, velocity, acceleration), shape (3, 3), that is wanted at a time [s]; return the row.

    Between rows a cubic with the rows' central differences as velocities; before the first and after the last at rest.
    """
    n = rows.shape[0]
    place = min(max(t / period, 0.0), float(n - 1))
    i = min(int(place), n - 1)
    j = min(i + 1, n - 1)
    s = place - i
    for k in range(3):
        a, b = rows[i, k], rows[j, k]
        before, after = rows[max(i - 1, 0), k], rows[min(j + 1, n - 1), k]
        u, w = 0.5 * (b - before), 0.5 * (after - a)
        if j == i:
            u, w = 0.0, 0.0
        c2, c3 = 3.0 * (b - a) - 2.0 * u - w, 2.0 * (a - b) + u + w
        motion[0, k] = a + s * (u + s * (c2 + s * c3))
        motion[1, k] = (u + s * (2.0 * c2 + 3.0 * s * c3)) / period
        motion[2, k] = (2.0 * c2 + 6.0 * s * c3) / (period * period)
    if place >= n - 1:
        motion[1:3] = 0.0
    return i
