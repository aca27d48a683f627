"""From the field's wrench to the commanded force: ceiling, ramp, energy tank, slew limit, and their faults.

The slew limit comes last, so that it also applies when the tank reduces a force. For some ticks the hand then gets more
than the tank allows; this energy is booked, and if it overdraws the tank, the next forces are reduced. A fault is
exempt from the slew limit: the force drops to zero at once.
"""

import numpy as np
from numba import njit

from controllers.safety.energy_tank import book_force, limit_power
from controllers.safety.faults import (
    FAULT_CODE,
    FORCE_NOT_FINITE,
    LIMITER_NOT_FINITE,
    TANK_NOT_FINITE,
    first_not_finite,
    latch,
    ramp_in,
)
from controllers.safety.limiter import LIMITER_FAULT, LIMITER_FORCE, bound_force, slew_force
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY
from geometry.arrays import Array


@njit
def command_force(
    limits: Array, limiter: Array, budget: Array, tank: Array, faults: Array, hand: Array, wrench: Array, force: Array
) -> None:
    """Force commanded to a device at this tick; zero from a fault on.

    Parameters
    ----------
    limits, limiter : Array
        Limits and memory of `controllers.safety.limiter`; the memory is updated.
    budget, tank : Array
        Parameters and memory of `controllers.safety.energy_tank`; the memory is updated.
    faults : Array
        Faults of the device (`controllers.safety.faults`); a non-finite value is latched.
    hand : Array
        The hand vector as measured.
    wrench : Array
        Wrench demanded by the field, shape (6,).
    force : Array
        Written [N], shape (3,).
    """
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    t = hand[HAND_TIME]
    sound = bound_force(limits, limiter, wrench, force)
    if not sound:
        code = limiter[LIMITER_FAULT]
        if code == FORCE_NOT_FINITE:
            latch(faults, FORCE_NOT_FINITE, t, first_not_finite(wrench))
        else:
            latch(faults, LIMITER_NOT_FINITE, t, first_not_finite(limiter))
    ramp_in(faults, force)
    if faults[FAULT_CODE] != 0.0:
        force[0] = force[1] = force[2] = 0.0
    # Checked before use, since min(e_max, NaN) would give a full tank.
    if not np.isfinite(np.sum(tank)):
        latch(faults, TANK_NOT_FINITE, t, first_not_finite(tank))
    limit_power(budget, tank, p, v, force)
    if faults[FAULT_CODE] == 0.0:
        slew_force(limits, limiter, force)
    else:
        for i in range(3):
            force[i] = limiter[LIMITER_FORCE + i] = 0.0
    book_force(tank, force)
