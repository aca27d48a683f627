"""Force limiter: saturation at a ceiling that depends on motor heat, a slew-rate limit, and a latch for faults."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from controllers.checks import check_positive
from controllers.errors import ParameterError
from controllers.safety.faults import FORCE_NOT_FINITE, LIMITER_NOT_FINITE
from geometry.arrays import Array

_CONTINUOUS, _PEAK, _HEAT_COEFFICIENT, _MAX_CHANGE = range(4)
THERMAL_TIME = 10.0
"""Thermal time constant of a motor's winding [s]: the RE 25's is of this order."""

LIMITER_HEAT, LIMITER_FORCE, LIMITER_FAULT, LIMITER_SIZE = 0, 1, 4, 5


@njit
def force_ceiling(heat: float, continuous: float, peak: float) -> float:
    """Largest force L [N] for a past mean square h [N²]: L² = F_c² + (F_p² − F_c²) max(0, 1 − h/F_c²)."""
    cold = np.maximum(0.0, 1.0 - heat / (continuous * continuous))
    return np.sqrt(continuous * continuous + (peak * peak - continuous * continuous) * cold)


@njit
def magnitude(x: float, y: float, z: float) -> float:
    """Norm of a vector, finite also where the squares of its components overflow."""
    largest = max(abs(x), abs(y), abs(z), 1e-300)
    return largest * np.sqrt((x / largest) ** 2 + (y / largest) ** 2 + (z / largest) ** 2)


@njit
def bound_force(limits: Array, limiter: Array, wrench: Array, force: Array) -> bool:
    """Saturate the force of a wrench at the device's ceiling for this tick.

    Parameters
    ----------
    limits : Array
        `ForceLimiter.limits`.
    limiter : Array
        Memory [h, last force (3), fault], written. Once a fault is set the force stays zero until the memory is
        renewed.
    wrench : Array, shape (6,)
        Wrench demanded by the field. The moment is dropped, since the device has motors for a force only; but a moment
        that is not finite is a fault too, since its computation is wrong.
    force : Array
        Written [N].

    Returns
    -------
    bool
        Whether there is no fault.
    """
    if not np.isfinite(limiter[LIMITER_HEAT] + limiter[1] + limiter[2] + limiter[3]):
        limiter[LIMITER_FAULT] = LIMITER_NOT_FINITE
    elif not np.isfinite(wrench[0] + wrench[1] + wrench[2] + wrench[3] + wrench[4] + wrench[5]):
        limiter[LIMITER_FAULT] = FORCE_NOT_FINITE
    # In this form the comparison is also true if the fault code itself is NaN.
    if limiter[LIMITER_FAULT] != 0.0:
        for i in range(3):
            force[i] = limiter[LIMITER_FORCE + i] = 0.0
        return False
    ceiling = force_ceiling(limiter[LIMITER_HEAT], limits[_CONTINUOUS], limits[_PEAK])
    scale = min(1.0, ceiling / max(magnitude(wrench[0], wrench[1], wrench[2]), 1e-300))
    for i in range(3):
        force[i] = scale * wrench[i]
    return True


@njit
def slew_force(limits: Array, limiter: Array, force: Array) -> None:
    """Limit the change of a bounded force from the last one to the slew rate, in place; store it, update the heat."""
    ceiling = force_ceiling(limiter[LIMITER_HEAT], limits[_CONTINUOUS], limits[_PEAK])
    change = 0.0
    for i in range(3):
        change += (force[i] - limiter[LIMITER_FORCE + i]) ** 2
    change = np.sqrt(change)
    if change > limits[_MAX_CHANGE]:
        for i in range(3):
            last = limiter[LIMITER_FORCE + i]
            force[i] = last + (force[i] - last) * (limits[_MAX_CHANGE] / change)
    norm = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    # The last force may have been allowed by a higher ceiling than the present one.
    scale = min(1.0, ceiling / max(norm, 1e-300))
    heat = limiter[LIMITER_HEAT]
    limiter[LIMITER_HEAT] = heat + limits[_HEAT_COEFFICIENT] * ((scale * norm) ** 2 - heat)
    for i in range(3):
        force[i] *= scale
        limiter[LIMITER_FORCE + i] = force[i]


@njit
def limit_force(limits: Array, limiter: Array, wrench: Array, force: Array) -> None:
    """Commanded force at this tick: `bound_force`, then `slew_force`, for a device without an energy tank.

    Parameters
    ----------
    limits, limiter, wrench, force
        As in `bound_force`.
    """
    if bound_force(limits, limiter, wrench, force):
        slew_force(limits, limiter, force)


def renew_limiter(limits: Array, limiter: Array) -> None:
    """Clear the fault in a memory: the force starts from zero, and an invalid heat is set to its highest value F_c²."""
    if not (np.isfinite(limiter[LIMITER_HEAT]) and limiter[LIMITER_HEAT] >= 0.0):
        limiter[LIMITER_HEAT] = limits[_CONTINUOUS] ** 2
    limiter[LIMITER_FORCE:LIMITER_SIZE] = 0.0


@dataclass(frozen=True)
class ForceLimiter:
    r"""Limits of the force at the stylus: continuous force, peak force, and slew rate.

    .. math:: |F| \le L(h), \qquad |\dot F| \le r, \qquad \dot h = (|F|^2 - h)/\tau

    The magnitude is scaled, the direction kept. h is the mean square of the force over the thermal time τ: a cold
    motor gives the peak force, a motor that has worked for several τ the continuous force (see `force_ceiling`). A
    non-finite force or memory is a fault: the force is zero from then on.

    Parameters
    ----------
    period : float
        Servo period T [s].
    continuous, peak : float
        F_c and F_p [N]; the defaults are the Premium 1.5's.
    thermal_time : float
        τ [s]; the order of a motor winding's time constant.
    slew : float
        r, largest change of the force [N/s].

    Raises
    ------
    ParameterError
        If a value is not positive and finite, or the peak force is below the continuous one.
    """

    period: float
    continuous: float = 1.5
    peak: float = 8.5
    thermal_time: float = THERMAL_TIME
    slew: float = 5000.0

    def __post_init__(self) -> None:
        check_positive("the limiter", self, "period", "continuous", "peak", "thermal_time", "slew")
        if self.peak < self.continuous:
            raise ParameterError(f"peak force {self.peak} N is below the continuous force {self.continuous} N")

    def limits(self) -> Array:
        """Parameters of `limit_force`."""
        share = 1.0 - np.exp(-self.period / self.thermal_time)
        return np.array([self.continuous, self.peak, share, self.slew * self.period])

    def fresh_memory(self) -> Array:
        """Memory of a cold device at rest without a fault."""
        return np.zeros(LIMITER_SIZE)
