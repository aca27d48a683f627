r"""Joint limits in a limb's inverse kinematics: smooth saturation, while the limb's end is in the air.

With v the rotation vector of a joint, and c(v) its components clamped to an interval each (`saturation`), the joint
becomes

.. math:: v' = v + A\,S(|v|)\,(c(v) - v)

A rises from 0 to 1 with the height of the end: on the ground, a joint may be a few degrees beyond its limit, since
avoiding foot skate has priority. S is 1, and falls to 0 as |v| goes to π, where v jumps to its opposite: no limb turns
so far, and the result stays continuous. Within the limits the joint is unchanged, bit for bit. In in-betweens of walk,
run, jump and backflip, joints exceed their limits by at most 2.4°, without saturation by 105°.
"""

import numpy as np
from numba import njit

from controllers.saturation import soft_clamp
from controllers.state import Quat
from geometry.arrays import Array
from geometry.easing import smooth_step, smooth_step_slope
from geometry.rotations import angular_velocity, exponential, logarithm, rotation_vector_rate

SATURATION_WIDTH = 0.1  # [rad] excess over a limit from which the joint stays at half of it beyond the limit
_FADE_START, _FADE_END = 2.9, 3.13  # [rad] range of |v| over which S falls
# [m] heights of the end between which A rises: on the ground, limits would move a foot by 7 cm
_GROUND_HEIGHT, _AIR_HEIGHT = 0.15, 0.35


@njit
def height_weight(height: float) -> tuple[float, float]:
    """A of an end at a height over the ground [m], and its derivative [1/m]."""
    x = (height - _GROUND_HEIGHT) / (_AIR_HEIGHT - _GROUND_HEIGHT)
    return smooth_step(x), smooth_step_slope(x) / (_AIR_HEIGHT - _GROUND_HEIGHT)


@njit
def saturate_joint(limits: Array, height: Array, q: Quat, rate: Array, tangents: int) -> None:
    """Saturate a joint near its limits.

    Parameters
    ----------
    limits : Array, shape (3, 2)
        Limits of the components of the joint's rotation vector [rad].
    height : Array, shape (1 + k,)
        Height of the limb's end over the ground [m], and its derivatives by k parameters.
    q : Quat
        Rotation of the joint; changed.
    rate : Array, shape (3, k)
        Local angular velocities with respect to the k parameters; changed.
    tangents : int
        k, or 0 to leave the rates unchanged.
    """
    air, rise = height_weight(height[0])
    if air == 0.0:
        return
    x, y, z = logarithm(q[0], q[1], q[2], q[3])
    (cx, sx), (cy, sy), (cz, sz) = (
        soft_clamp(x, limits[0, 0], limits[0, 1], SATURATION_WIDTH),
        soft_clamp(y, limits[1, 0], limits[1, 1], SATURATION_WIDTH),
        soft_clamp(z, limits[2, 0], limits[2, 1], SATURATION_WIDTH),
    )
    if cx == x and cy == y and cz == z:
        return
    size = np.sqrt(x * x + y * y + z * z)
    nearly = (size - _FADE_START) / (_FADE_END - _FADE_START)
    left, slope = 1.0 - smooth_step(nearly), -smooth_step_slope(nearly) / (_FADE_END - _FADE_START)
    share = air * left
    ax, ay, az = cx - x, cy - y, cz - z
    hx, hy, hz = x + share * ax, y + share * ay, z + share * az
    q[0], q[1], q[2], q[3] = exponential(hx, hy, hz)
    for k in range(tangents):
        dx, dy, dz = rotation_vector_rate(x, y, z, rate[0, k], rate[1, k], rate[2, k])
        change = air * slope * (x * dx + y * dy + z * dz) / size + rise * height[1 + k] * left
        rate[0, k], rate[1, k], rate[2, k] = angular_velocity(
            hx, hy, hz,
            dx + share * (sx - 1.0) * dx + change * ax,
            dy + share * (sy - 1.0) * dy + change * ay,
            dz + share * (sz - 1.0) * dz + change * az,
        )  # fmt: skip
