r"""Cross-track filter: the figure changes from one river's clip to another's more slowly than the hand crosses over.

On a lifted map rivers hand a stylus over within 0.3 to 0.4 s whatever the push, and a figure cannot break from a walk
into a run so fast. So the map is evaluated at the hand's angle θ round the z axis of H, but in the half plane (r, z) at

.. math:: y = (1 - s)\,q_a(\theta) + s\,q_b(\theta) + e

with q_a and q_b the sites of the former and of the active river at θ: the share s begins at 0 when river b takes over,
and follows 1, and e follows s d, the hand's offset d = (r, z) − q_b from its river, both with critical damping,

.. math:: \ddot s = \omega^2 (1 - s) - 2 \omega \dot s .

On its curve a hand has d = 0: no clip is played differently, and none lags in phase. A river that takes over before
s = 1 begins where y is.
"""

import math

import numpy as np
from numba import njit

from controllers.curves.splines import control_points, interpolate
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.work_array import work_array
from geometry.arrays import Array

# Parameters: ω, numbers of rows and rivers, then the control points of the sites, as (r, z) of each river, row by row.
_OMEGA, _ROWS, _RIVERS, _CONTROL = range(4)
# State: rivers a and b, −1 before the first; s and its rate; e, and its rate, each as (r, z).
_FORMER, _ACTIVE, _SHARE, _SHARE_RATE, _OFFSET, _OFFSET_RATE, _SIZE = 0, 1, 2, 3, 4, 6, 8


def packed_cross_track(rate: float, sites: Array) -> Array:
    """Parameters of the filter.

    Parameters
    ----------
    rate : float
        ω [1/s].
    sites : Array, shape (rows, rivers, 2)
        (r, z) [m] of every river at `rows` equal steps of the lap.
    """
    return np.concatenate([[rate, *sites.shape[:2]], control_points(sites, np.ones(1)).ravel()])


def no_cross_track() -> Array:
    """State before any river is active."""
    state = np.zeros(_SIZE)
    state[_FORMER] = state[_ACTIVE] = -1.0
    return state


@njit
def _settle(state: Array, value: int, rate: int, goal: float, omega: float, period: float) -> None:
    """Advance a number and its rate towards a goal with critical damping: exact for a constant goal."""
    behind = state[value] - goal
    grown, decay = state[rate] + omega * behind, math.exp(-omega * period)
    state[value] = goal + (behind + grown * period) * decay
    state[rate] = (state[rate] - omega * grown * period) * decay


@njit
def shift_across(params: Array, state: Array, trace: Array, p: Array, period: float) -> None:
    """Replace a measured position of the stylus by the one at which the map is evaluated.

    Parameters
    ----------
    params : Array
        `packed_cross_track`.
    state : Array, shape (8,)
        `no_cross_track` at first; updated.
    trace : Array
        Trace of the field, with the active river.
    p : Array, shape (3,) or more
        Position in H [m]; updated.
    period : float
        Time since the last call [s].
    """
    radius, river = math.hypot(p[0], p[1]), trace[TRACE_RIVER]
    if radius == 0.0 or (river < 0.0 and state[_ACTIVE] < 0.0):
        return
    rows, rivers = int(params[_ROWS]), int(params[_RIVERS])
    step = (math.atan2(p[1], p[0]) / (2.0 * math.pi) % 1.0) * rows
    row = min(int(step), rows - 1)
    sites, slopes = work_array((rivers, 2)), work_array((rivers, 2))
    first = _CONTROL + 2 * rivers * row
    interpolate(params[first:], 2 * rivers, step - row, 1.0, sites.reshape(-1), slopes.reshape(-1))
    place = (radius, p[2])
    if state[_ACTIVE] < 0.0:
        state[_FORMER], state[_ACTIVE], state[_SHARE] = river, river, 1.0
        for i in range(2):
            state[_OFFSET + i] = place[i] - sites[int(river), i]
    elif river >= 0.0 and river != state[_ACTIVE]:
        for i in range(2):
            way = sites[int(state[_ACTIVE]), i] - sites[int(state[_FORMER]), i]
            state[_OFFSET + i] += (state[_SHARE] - 1.0) * way
            state[_OFFSET_RATE + i] += state[_SHARE_RATE] * way
        state[_FORMER], state[_ACTIVE], state[_SHARE], state[_SHARE_RATE] = state[_ACTIVE], river, 0.0, 0.0
    _settle(state, _SHARE, _SHARE_RATE, 1.0, params[_OMEGA], period)
    share, shown = state[_SHARE], work_array(2)
    for i in range(2):
        former, active = sites[int(state[_FORMER]), i], sites[int(state[_ACTIVE]), i]
        _settle(state, _OFFSET + i, _OFFSET_RATE + i, share * (place[i] - active), params[_OMEGA], period)
        shown[i] = former + share * (active - former) + state[_OFFSET + i]
    p[0], p[1], p[2] = shown[0] / radius * p[0], shown[0] / radius * p[1], shown[1]
