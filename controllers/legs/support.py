r"""Ground support of blends: keeps the lowest foot on the ground when the clips of a blend stand on different feet.

With the clearances h̄_j of the limbs' ends in the blend and h_ij in clip i, all ends are lowered by

.. math:: c = S(m(\bar h)) - \textstyle\sum_i w_i\, S(m(h_i))

m is a soft minimum over the limbs, S(x) = y³/(y² + s²) with y = x − x₀, 0 where y < 0: c is, smoothly, the excess of
the blend's lowest clearance over those of the clips, so that flights common to all clips remain. A clip alone is left
unchanged, and an end on the ground is not pushed into it. The threshold x₀ leaves room for a swing foot, which is not
dragged over the ground.
"""

import numpy as np
from numba import njit

from controllers.state import Array
from controllers.work_array import work_array

_SOFTNESS = 0.003  # [m] softness of the minimum, and s
_ROOM = 0.006  # [m] x₀


@njit
def _raised(clearance: Array, rates: Array, change: Array) -> float:
    """S(m(h)) of clearances (limbs,); writes its derivatives `change` (k,) from those of the clearances (limbs, k)."""
    least, total = clearance[0], 0.0
    for h in clearance:
        least = min(least, h)
    for h in clearance:
        total += np.exp((least - h) / _SOFTNESS)
    m = least - _SOFTNESS * np.log(total) - _ROOM
    change[:] = 0.0
    if m <= 0.0:
        return 0.0
    square, s2 = m * m, _SOFTNESS * _SOFTNESS
    slope = square * (square + 3.0 * s2) / (square + s2) ** 2
    for j in range(len(clearance)):
        share = slope * np.exp((least - clearance[j]) / _SOFTNESS) / total
        for k in range(len(change)):
            change[k] += share * rates[j, k]
    return m * square / (square + s2)


@njit
def lowering(value: Array, slope: Array, weights: Array, changes: Array, lower: Array) -> None:
    """Lowering c of the ends, and its derivatives.

    Parameters
    ----------
    value, slope : Array, shape (clips, limbs)
        Clearances [m] and their derivatives by θ.
    weights, changes : Array, shapes (clips,), (3, clips)
        Weights of the clips, and their derivatives by θ and two other parameters.
    lower : Array, shape (4,)
        Written: c [m] and its derivatives by the three parameters.
    """
    clips, limbs = value.shape
    mean, rates, own, change = work_array(limbs), work_array((limbs, 3)), work_array((limbs, 1)), work_array(1)
    mean[:], rates[:] = 0.0, 0.0
    for i in range(clips):
        for j in range(limbs):
            mean[j] += weights[i] * value[i, j]
            rates[j, 0] += weights[i] * slope[i, j]
            for k in range(3):
                rates[j, k] += changes[k, i] * value[i, j]
    lower[0] = _raised(mean, rates, lower[1:])
    for i in range(clips):
        for j in range(limbs):
            own[j, 0] = slope[i, j]
        height = _raised(value[i], own, change)
        lower[0] -= weights[i] * height
        lower[1] -= weights[i] * change[0]
        for k in range(3):
            lower[1 + k] -= changes[k, i] * height
