r"""Minimum-jerk submovements: quintic polynomials between two states of motion.

.. math:: x(t) = \sum_{i=0}^{5} c_i\, (t/D)^i

minimises ∫|x⃛|² between two states (position, velocity, acceleration) in a time D; from rest to rest it is
10 s³ − 15 s⁴ + 6 s⁵ (Flash & Hogan 1985). A submovement that begins during another superposes on it (Flash & Henis
1991).
"""

import numpy as np
from numba import njit

from geometry.arrays import Array

MAX_SUBMOVEMENTS = 8  # largest number of submovements planned to a target; more would leave 1/2000 of the distance


@njit
def set_submovement(plan: Array, start: Array, goal: Array, seconds: float) -> None:
    """Set the coefficients of a submovement.

    Parameters
    ----------
    plan : Array
        Set: coefficients c, shape (6, 3).
    start, goal : Array
        Position [m], velocity [m/s] and acceleration [m/s²] at both ends, shape (3, 3).
    seconds : float
        D [s].
    """
    d = seconds
    for k in range(3):
        x0, v0, a0 = start[0, k], start[1, k] * d, start[2, k] * d * d
        x1, v1, a1 = goal[0, k], goal[1, k] * d, goal[2, k] * d * d
        way, turn, bend = x1 - x0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
        plan[0, k], plan[1, k], plan[2, k] = x0, v0, 0.5 * a0
        plan[3, k] = 10.0 * way - 4.0 * turn + 0.5 * bend
        plan[4, k] = -15.0 * way + 7.0 * turn - bend
        plan[5, k] = 6.0 * way - 3.0 * turn + 0.5 * bend


@njit
def submovement(plan: Array, seconds: float, elapsed: float, state: Array) -> None:
    """Set the state (position, velocity, acceleration), shape (3, 3), at a time `elapsed` [s] after its start.

    After its end the motion continues with its final velocity.
    """
    s = min(elapsed / seconds, 1.0)
    beyond = max(elapsed - seconds, 0.0)
    for k in range(3):
        c0, c1, c2, c3, c4, c5 = plan[0, k], plan[1, k], plan[2, k], plan[3, k], plan[4, k], plan[5, k]
        speed = (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / seconds
        state[0, k] = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))) + beyond * speed
        state[1, k] = speed
        bend = (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (seconds * seconds)
        state[2, k] = bend if beyond == 0.0 else 0.0


@njit
def aimed_seconds(difficulty: float, scatter: float, overhead: float, least: float) -> float:
    r"""Duration [s] of the next submovement to a target, for the number of submovements that is fastest in total.

    After Meyer et al. 1988: n submovements, each of which leaves the same share of its length A as an error of z
    standard deviations σ = K A/D, take

    .. math:: \min_n\ n \bigl(D_0 + \max(D_{min},\ z K x^{1/n})\bigr)

    Parameters
    ----------
    difficulty : float
        x, the distance over half of the target's width.
    scatter : float
        z K, number of standard deviations times the constant of σ [s].
    overhead : float
        D₀, time to see where a submovement ends [s].
    least : float
        D_min, duration of the shortest submovement [s].
    """
    shortest_total, seconds = np.inf, least
    for n in range(1, MAX_SUBMOVEMENTS + 1):
        each = max(least, scatter * max(difficulty, 1.0) ** (1.0 / n))
        if n * (overhead + each) < shortest_total:
            shortest_total, seconds = n * (overhead + each), each
    return seconds
