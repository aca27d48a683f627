r"""Floor constraint of a blend: feet do not go below the lowest point of all clips, whatever the sum of corrections.

With l = z + m(R s_k) the height of an end (foot), m a soft minimum over its points s_k, and l₀ the lowest over all
clips' frames, the end is raised by S(l₀ − l); S(x) = x³/(x² + s²), 0 for x < 0: C², and within s/2 of x. A clip alone
is left unchanged. For 30 hands that wander at random among nine lifted clips the lowest sole is at −12 mm; without
this constraint it is at −126 mm.
"""

import numpy as np
from numba import njit

from controllers.state import Quat
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import rotate

SOFTNESS = 2e-3
"""Softness of the minimum of sole heights when a pose is put on the floor [m]: four points at equal height count as
3 mm (ln 4 times the softness) lower."""

_ROUNDING_LENGTH = 4e-3  # s [m]


@njit
def keep_above(floor: float, sole: Array, end: Array, q: Quat, rate: Array, tangents: int) -> None:
    """Raise a limb's end that goes below the floor.

    Parameters
    ----------
    floor : float
        l₀ [m].
    sole : Array, shape (k, 3)
        Points that may touch, from their centre, in the frame of the end [m].
    end : Array, shape (1 + n, 3)
        Position of the centre, and its derivatives by n parameters; changed.
    q : Quat
        Orientation of the end.
    rate : Array, shape (3, n)
        Local angular velocities of the end with respect to the parameters.
    tangents : int
        n, or 0 to leave the derivatives unchanged.
    """
    least, heights = np.inf, work_array(sole.shape[0])
    for i in range(sole.shape[0]):
        _, _, heights[i] = rotate(q[0], q[1], q[2], q[3], sole[i, 0], sole[i, 1], sole[i, 2])
        least = min(least, heights[i])
    if floor - end[0, 2] - least <= -SOFTNESS * np.log(float(sole.shape[0])):
        return
    total = 0.0
    for i in range(sole.shape[0]):
        heights[i] = np.exp((least - heights[i]) / SOFTNESS)
        total += heights[i]
    x = floor - end[0, 2] - least + SOFTNESS * np.log(total)
    if x <= 0.0:
        return
    square, s2 = x * x, _ROUNDING_LENGTH * _ROUNDING_LENGTH
    slope = square * (square + 3.0 * s2) / (square + s2) ** 2
    end[0, 2] += x * square / (square + s2)
    # The vertical in the frame of the end: a point s moves up by ω·(s × up).
    up_x, up_y, up_z = rotate(q[0], -q[1], -q[2], -q[3], 0.0, 0.0, 1.0)
    lever_x = lever_y = lever_z = 0.0
    for i in range(sole.shape[0]):
        share = heights[i] / total
        lever_x += share * (sole[i, 1] * up_z - sole[i, 2] * up_y)
        lever_y += share * (sole[i, 2] * up_x - sole[i, 0] * up_z)
        lever_z += share * (sole[i, 0] * up_y - sole[i, 1] * up_x)
    for k in range(tangents):
        rise = end[1 + k, 2] + rate[0, k] * lever_x + rate[1, k] * lever_y + rate[2, k] * lever_z
        end[1 + k, 2] -= slope * rise
