r"""Submovements of least jerk: quintic polynomials between states of rest or motion.

.. math:: x(t) = \sum_{i=0}^{5} c_i\, (t/D)^i

is the motion of least ∫|x⃛|² between two states (position, velocity, acceleration) in a time D; from rest to rest it is
10 s³ − 15 s⁴ + 6 s⁵ (Flash & Hogan 1985). A new one that begins in the middle of another is their superposition
(Flash & Henis 1991).
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]


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
    """Set the state (position, velocity, acceleration), shape (3, 3), so long [s] after a submovement began.

    After its end it goes on at the speed that it ends with.
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


def refinement(scatter: float, overhead: float) -> float:
    r"""Share of the way to a target that a submovement should leave to the next: the fastest way to get near.

    A submovement that leaves a share r of its way within `caution` standard deviations of scatter lasts z K/r, so a
    factor 1/r costs D₀ + z K/r and a bit of accuracy

    .. math:: \min_r \frac{D_0 + z K/r}{\log_2 (1/r)}

    (the optimised submovements of Meyer et al. 1988, as many as it takes).

    Parameters
    ----------
    scatter : float
        z K, standard deviations times the constant of σ = K A/T [s].
    overhead : float
        D₀, to see how far a submovement has come and to begin the next [s].
    """
    shares = np.geomspace(0.02, 0.6, 200)
    cost = (overhead + scatter / shares) / -np.log2(shares)
    return float(shares[int(np.argmin(cost))]) if math.isfinite(scatter) and scatter > 0.0 else float(shares[0])
