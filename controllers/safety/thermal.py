r"""Thermal model of the motors: i²t of each, and the torque ceiling that follows from it.

.. math:: \dot h_i = (\tau_i^2 - h_i)/\tau_{th}, \qquad |\tau_i| \le L_i(h_i),
          \quad L_i^2 = c_i^2 + (p_i^2 - c_i^2) \max(0, 1 - h_i/c_i^2)

Copper loss is proportional to the square of the current, and the winding cools: h is the mean square of the torque over
the winding's time constant, and h = c² is the steady state at the continuous torque c. p is the stall torque. With the
ceiling L no demand takes h above c², as long as T/τ_th ≤ c²/p² for the period T (0.0001 against 0.05 for a Phantom at
1 kHz). Maxon's data sheets give c, p and the time constant; the `ForceLimiter` has the same law for the force.
"""

import numpy as np
from numba import njit

from controllers.safety.limiter import force_ceiling
from geometry.arrays import Array


@njit
def limit_by_heat(
    heat: Array, continuous: tuple[float, float, float], peak: tuple[float, float, float], share: float, torque: Array
) -> float:
    """Scale joint torques in place to the ceilings that the motors' heat allows, and update the heat.

    All three are scaled by the same factor, so that the force keeps its direction.

    Parameters
    ----------
    heat : Array
        h_i [N² m²], shape (3,); written. An invalid value is set to the highest, c_i².
    continuous, peak : three floats
        c_i, p_i [N m].
    share : float
        ``1 − exp(−T/τ_th)`` of a period T.
    torque : Array
        [N m], shape (3,); written.

    Returns
    -------
    float
        Largest used fraction of a motor's thermal capacity, max h_i/c_i².
    """
    scale = 1.0
    for i in range(3):
        if not np.isfinite(heat[i]) or heat[i] < 0.0:
            heat[i] = continuous[i] * continuous[i]
        ceiling = force_ceiling(heat[i], continuous[i], peak[i])
        if abs(torque[i]) * scale > ceiling:
            scale = ceiling / abs(torque[i])
    used = 0.0
    for i in range(3):
        torque[i] *= scale
        heat[i] += share * (torque[i] * torque[i] - heat[i])
        used = max(used, heat[i] / (continuous[i] * continuous[i]))
    return used
