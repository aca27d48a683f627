r"""A gait that is led, and when it flies: at the entry of a stance it is decided whether the next flight is flown.

What flies must have the pace for it, and in the air nothing can be changed. So u, how far a figure stays on the ground
(0: it flies as its clip does, 1: it does not, see `controllers.legs.grounded`), changes in stances only,

.. math:: u = u_0 + (u_1 - u_0)\,S(x), \qquad S(x) = x^3 (10 - 15 x + 6 x^2)

from what it was at the entry to what is decided there. x goes from 0 to 1 in the first `WITHIN` of a stance before a
flight, so that the figure pushes off as in its clip, and in the last of one after a flight, where it lands as in its
clip. Going back in a stance takes back what was done in it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.state import Array

# A decision: u, u at the entry of the stance, what it becomes, and the share of the stance at
# which it was entered, 0 or 1; −1 in flight.
_HELD, _BEFORE, _AIM, _ENTRY, DECISION = range(5)

# Of a stance. With less the floor would have to pull a figure down that lands, with more one that pushes off.
WITHIN = 0.8


def fresh_decision(flies: bool) -> Array:
    """What is decided of a figure that has not been led yet: it stays on the ground, in a stance."""
    held = float(flies)
    return np.array([held, held, held, 0.0])


@njit
def share_of_stance(stances: Array, lap: float) -> float:
    """How much of the stance at a place in the lap is over, −1 in flight; `stances` as `Gait.stances`, flat."""
    for k in range(len(stances) // 2):
        begin, length = stances[2 * k], stances[2 * k + 1]
        gone = lap - begin - np.floor(lap - begin)
        if gone < length:
            return gone / length
    return -1.0


@njit
def decide_flight(decision: Array, share: float, speed: float, take_off: float, landing: float) -> float:
    """Update what is decided of the next flight; returns u.

    Parameters
    ----------
    decision : Array, shape (4,)
        See `fresh_decision`; written.
    share : float
        Of the stance that is over, −1 in flight.
    speed, take_off, landing : float
        Of the figure, and from which on it begins to fly, and goes on to fly [m/s].
    """
    if share < 0.0:
        decision[_ENTRY] = -1.0
        return decision[_HELD]
    if decision[_ENTRY] < 0.0:
        flew = decision[_HELD] < 0.5
        decision[_ENTRY], decision[_BEFORE] = np.floor(share + 0.5), decision[_HELD]
        decision[_AIM] = 0.0 if speed >= (landing if flew else take_off) else 1.0
    x = abs(share - decision[_ENTRY])
    x = min(x / WITHIN, 1.0) if decision[_AIM] < decision[_BEFORE] else max(1.0 - (1.0 - x) / WITHIN, 0.0)
    x = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    decision[_HELD] = decision[_BEFORE] + x * (decision[_AIM] - decision[_BEFORE])
    return decision[_HELD]


@dataclass(frozen=True, eq=False)
class Gait:
    """How a figure goes straight on, over one lap of its clip.

    Parameters
    ----------
    stride : float
        Arc length of a lap [m].
    speed : float
        The clip's own [m/s].
    support : Array
        Feet that bear at equal steps of the lap, from s = 0 on: 0, 1 or 2.
    reach : float
        How far ahead of the figure, or behind it, a foot is on the path, at most [m].
    grounded : bool
        Whether it is a run of which no flight is left: its limbs swing as fast already as they do in a run.

    Raises
    ------
    ParameterError
        If a length or the speed is not positive and finite, or the support is not of 0, 1 and 2.
    """

    stride: float
    speed: float
    support: npt.NDArray[np.int64]
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
        """Whether there are moments at which no foot bears."""
        return not self.support.all()

    @property
    def stances(self) -> Array:
        """Where in the lap each time on the ground begins and how long it lasts, shares of the lap, shape (k, 2).

        There are none if it is always on the ground.
        """
        n, stands = len(self.support), self.support > 0
        first = np.flatnonzero(stands & ~np.roll(stands, 1))
        last = np.flatnonzero(stands & ~np.roll(stands, -1))
        if len(first) and last[0] < first[0]:
            last = np.roll(last, -1)
        return np.stack([first, (last - first) % n + 1], axis=1) / n
