"""Wishes of a person over time: the table into which an intent is converted, and its interpolation."""

from dataclasses import dataclass, field

import numpy as np
from numba import njit, types

from controllers.kernel_call import kernel_call
from geometry.arrays import Array
from sim.errors import SimError

PLACE, FORCE, GRIP, WIDTH, SWITCH, ENGAGED, WISH_SIZE = 0, 3, 6, 7, 8, 9, 10
"""Columns of a wish: position (3) [m] and force (3) [N] in H, grip [N] or NaN for the person's own, width of a target
[m], 1 if the switch is pressed, and 1 if the person is active; otherwise she lets the field lead the stylus."""
OWN = -1.0
"""Value of `Wishes.period` that marks wishes written by a user-defined intent."""
_VECTOR = types.Array(types.float64, 1, "C")
INTENT_ARGUMENTS = (types.float64, _VECTOR, _VECTOR, types.Array(types.float64, 2, "C"))
call_intent = kernel_call(INTENT_ARGUMENTS)
"""Calls a compiled user-defined intent (see `sim.users.intents.own`) with ``(t, place, force, rows)``, from compiled
code. It writes two rows: the wish now, and in the place columns of the second row the velocity of the wanted place."""


@dataclass(frozen=True)
class Wishes:
    """Wishes of a person, either sampled in time or as a sequence of targets.

    Parameters
    ----------
    rows : Array
        Wishes, shape (n, 10), columns as above.
    period : float
        Time between two rows [s]; 0 if each row is a target, to be reached before the next one; negative if a
        user-defined intent writes the two rows (see `call_intent`).
    lap : float
        Period with which the wishes repeat, for learning from one repetition to the next [s]; 0: never.

    Raises
    ------
    SimError
        If the table has another shape or no row, a number is not finite, or a target has no width.
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
    """Rows of a passive person, shape (n, 10)."""
    rows = np.zeros((n, WISH_SIZE))
    rows[:, GRIP] = np.nan
    return rows


def following(points: Array) -> Array:
    """Rows of a person who follows points (n, 3) in H, shape (n, 10)."""
    rows = resting(len(points))
    rows[:, PLACE : PLACE + 3], rows[:, ENGAGED] = points, 1.0
    return rows


def targets(points: Array, width: float) -> Wishes:
    """Wishes to reach and click targets (n, 3) in turn; `width` [m] is along the line from the previous target."""
    rows = following(points)
    rows[:, WIDTH] = width
    return Wishes(rows, period=0.0)


@njit
def wanted_motion(rows: Array, period: float, t: float, motion: Array) -> int:
    """Set the wanted motion (position, velocity, acceleration), shape (3, 3), at a time t [s]; returns the row's index.

    Rows are interpolated by cubics with central differences as velocities; after the last row the motion is at rest.
    """
    n = rows.shape[0]
    position = min(max(t / period, 0.0), float(n - 1))
    i = min(int(position), n - 1)
    j = min(i + 1, n - 1)
    s = position - i
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
    if position >= n - 1:
        motion[1:3] = 0.0
    return i
