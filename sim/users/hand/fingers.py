"""The simulated fingers: the moment that turns the stylus; the arm moves its tip (see `sim.users.hand.arm`)."""

import math

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import angular_velocity, exponential, logarithm, multiply
from sim.users.hand.actions import Records


@njit
def wanted_turn(turns: Records, t: float, turn: Array, rate: Array) -> None:
    """Set the rotation vector r [rad] of the intended orientation at time t, and ṙ [rad/s], shape (3,) each.

    Parameters
    ----------
    turns : Records
        A `sim.users.hand.actions.turn_table`.
    t, turn, rate
        Time [s] and results, in H.
    """
    turn[:], rate[:] = 0.0, 0.0
    for i in range(turns.shape[0]):
        wanted = turns[i]
        phase = math.pi * (t - wanted.start) / wanted.duration
        if 0.0 < phase < math.pi:
            share, change = math.sin(phase) ** 2, math.pi / wanted.duration * math.sin(2.0 * phase)
            for k in range(3):
                turn[k] += share * wanted.peak[k]
                rate[k] += change * wanted.peak[k]


@njit
def turning_moment(
    stiffness: float, damping: float, turns: Records, t: float, q: Array, w: Array, moment: Array
) -> None:
    r"""Set the moment of fingers that hold the stylus at the intended orientation R_d: k log(R_d Rᵀ) + b (ω_d − ω).

    Parameters
    ----------
    stiffness, damping : float
        k [N m/rad], b [N m s/rad].
    turns : Records
        A `sim.users.hand.actions.turn_table`.
    t : float
        Time [s].
    q, w : Array
        R_H (unit quaternion wxyz) and ω_H [rad/s] of the stylus, shapes (4,), (3,).
    moment : Array
        Set [N m], in H, shape (3,).
    """
    r, rate = work_array(3), work_array(3)
    wanted_turn(turns, t, r, rate)
    a, b, c, d = exponential(r[0], r[1], r[2])
    error = logarithm(*multiply(a, b, c, d, q[0], -q[1], -q[2], -q[3]))
    # With −r and ṙ this is ω_d in the frame H, not in the frame of the stylus.
    speed = angular_velocity(-r[0], -r[1], -r[2], rate[0], rate[1], rate[2])
    for k in range(3):
        moment[k] = stiffness * error[k] + damping * (speed[k] - w[k])
