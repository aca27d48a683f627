r"""Gait of a led figure, and the decision, made at the entry of each stance, whether the next flight phase is taken.

A flight phase needs speed, and nothing can be changed in the air. So u, the share of the grounded form (0: flight
phases as in the clip, 1: none, see `controllers.legs.grounded`), changes in stances only,

.. math:: u = u_0 + (u_1 - u_0)\,S(x), \qquad S(x) = x^3 (10 - 15 x + 6 x^2)

from its value u_0 at the entry to the value u_1 decided there. If u falls (a flight follows), x goes from 0 to 1 in the
first part of the stance (`TRANSITION_FRACTION`), so that the figure pushes off as in its clip; if u rises, in the last
part of the same length, so that it lands as in its clip. Going back within a stance reverses the change.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from geometry.arrays import Array, IntArray
from geometry.easing import smooth_step

# Indices of a decision: u, u_0 at the entry of the stance, u_1, and the end of the stance at which it was entered
# (0: its begin; 1: its end, when walking backwards; −1: in flight).
_SHARE, _START_SHARE, _TARGET_SHARE, _ENTRY_END, DECISION = range(5)

# Fraction of a stance over which u changes. If it is smaller, the floor would have to pull on a figure that lands; if
# larger, on one that pushes off: downward accelerations reach 8 m/s² with 0.8, as in the run itself, and 14 with 0.6.
TRANSITION_FRACTION = 0.8


def fresh_decision(flies: bool) -> Array:
    """Decision of a figure that has not been led yet: grounded, in a stance; `flies`: the gait has flight phases."""
    share = float(flies)
    return np.array([share, share, share, 0.0])


@njit
def share_of_stance(stances: Array, lap: float) -> float:
    """Elapsed share of the stance at a phase `lap` [laps], −1 in flight; `stances` are `Gait.stances`, flattened."""
    for k in range(len(stances) // 2):
        begin, length = stances[2 * k], stances[2 * k + 1]
        gone = lap - begin - np.floor(lap - begin)
        if gone < length:
            return gone / length
    return -1.0


@njit
def decide_flight(decision: Array, share: float, speed: float, take_off: float, landing: float) -> float:
    """Update the decision on the next flight phase, with hysteresis; returns u.

    Parameters
    ----------
    decision : Array, shape (4,)
        See `fresh_decision`; written.
    share : float
        Elapsed share of the stance, −1 in flight.
    speed, take_off, landing : float
        Speed of the figure, and the least speeds at which flight phases begin, and at which they continue [m/s].
    """
    if share < 0.0:
        decision[_ENTRY_END] = -1.0
        return decision[_SHARE]
    if decision[_ENTRY_END] < 0.0:
        flew = decision[_SHARE] < 0.5
        decision[_ENTRY_END], decision[_START_SHARE] = np.floor(share + 0.5), decision[_SHARE]
        decision[_TARGET_SHARE] = 0.0 if speed >= (landing if flew else take_off) else 1.0
    x = abs(share - decision[_ENTRY_END])
    x = (
        min(x / TRANSITION_FRACTION, 1.0)
        if decision[_TARGET_SHARE] < decision[_START_SHARE]
        else max(1.0 - (1.0 - x) / TRANSITION_FRACTION, 0.0)
    )
    decision[_SHARE] = decision[_START_SHARE] + smooth_step(x) * (decision[_TARGET_SHARE] - decision[_START_SHARE])
    return decision[_SHARE]


@dataclass(frozen=True, eq=False)
class Gait:
    """Straight gait of a figure over one lap of its clip.

    Parameters
    ----------
    stride : float
        Arc length of a lap [m].
    speed : float
        The clip's own speed [m/s].
    support : Array
        Number of feet that bear load at equal steps of the lap, from s = 0 on: 0, 1 or 2.
    reach : float
        Largest distance along the path of a foot from the figure, ahead or behind [m].
    grounded : bool
        Whether it is a run without its flight phases, with limbs that already swing as fast as in the run.

    Raises
    ------
    ParameterError
        If a length or the speed is not positive and finite, or the support is not of 0, 1 and 2.
    """

    stride: float
    speed: float
    support: IntArray
    reach: float
    grounded: bool = False

    def __post_init__(self) -> None:
        checked("stride", self.stride, "m", least=0.01)
        checked("speed", self.speed, "m/s", least=0.01)
        checked("reach", self.reach, "m")
        if self.support.ndim != 1 or len(self.support) < 2 or not np.isin(self.support, (0, 1, 2)).all():
            raise ParameterError("the support of a gait is 0, 1 or 2 feet at two or more steps of the lap")

    @property
    def flies(self) -> bool:
        """Whether the gait has flight phases, in which no foot bears load."""
        return not self.support.all()

    @property
    def stances(self) -> Array:
        """Begin and duration of each interval with ground contact, as shares of the lap, shape (k, 2).

        Empty if the gait has no flight phases.
        """
        n, stance = len(self.support), self.support > 0
        first = np.flatnonzero(stance & ~np.roll(stance, 1))
        last = np.flatnonzero(stance & ~np.roll(stance, -1))
        if len(first) and last[0] < first[0]:
            last = np.roll(last, -1)
        return np.stack([first, (last - first) % n + 1], axis=1) / n
