r"""Cores of curves: dead zones in which the map plays one curve's clip alone, so that tremor does not blend clips.

Before the weights are computed, a point q within the core radius b_i(θ) of a site q_i(θ) is drawn towards the site:

.. math:: q \mapsto q_i + S\!\left(\frac{|q - q_i|}{b_i}\right) (q - q_i), \qquad S(x) = 10 x^3 - 15 x^4 + 6 x^5 ,

This is C², the identity from b_i on, at most 1.8 times as steep, and of fourth order at the site: a hand at a quarter
of the core radius is drawn to a fortieth of it. Cores do not overlap.

The reason: late in a lap, clips whose curves are millimetres apart differ by metres in the distance travelled. Hand
motion by a tenth of a millimetre sideways in a fiftieth of a second would accelerate the body by more than gravity.
"""

import numpy as np
from numba import njit

from controllers.curves.splines import periodic_interpolation
from geometry.arrays import Array
from geometry.easing import smooth_step

# [m] largest core radius: h_* of walk, run, jump and backflip changes by 12 % per millimetre, with half or twice the
# radius by 11 or 13 %.
_MAX_CORE_RADIUS = 8e-3
# core radius over the distance to the nearest other site: less than half, so that cores do not touch
_RADIUS_RATIO = 0.45
_SAMPLES_PER_ROW = 4  # samples of a distance from one row to the next


@njit
def attract_to_core(r: float, z: float, sites: Array, slopes: Array, place: Array, change: Array) -> bool:
    """Draw a point towards the site whose core contains it; returns whether there is such a site.

    Parameters
    ----------
    r, z : float
        The point [m].
    sites, slopes : Array, shape (m, 4)
        Sites of the nearby clips, from `near_clips`: r, z, reach, core; and their derivatives by θ.
    place : Array, shape (2,)
        Written: the point after drawing in [m].
    change : Array, shape (3, 2)
        Written: derivatives of that by θ, r and z.
    """
    for i in range(sites.shape[0]):
        x, y, core = r - sites[i, 0], z - sites[i, 1], sites[i, 3]
        share = np.sqrt(x * x + y * y) / core
        if share >= 1.0:
            continue
        s = smooth_step(share)
        # S' over the share, so that at the site nothing is divided by zero.
        g = 30.0 * share * (1.0 - share) * (1.0 - share)
        place[0], place[1] = sites[i, 0] + s * x, sites[i, 1] + s * y
        rate = g * ((x * slopes[i, 0] + y * slopes[i, 1]) / core + share * share * slopes[i, 3]) / core
        change[0, 0], change[0, 1] = (1.0 - s) * slopes[i, 0] - rate * x, (1.0 - s) * slopes[i, 1] - rate * y
        change[1, 0], change[2, 1] = s + g * x * x / (core * core), s + g * y * y / (core * core)
        change[1, 1] = change[2, 0] = g * x * y / (core * core)
        return True
    return False


def core_points(sites: Array) -> Array:
    """Control points (rows + 3, m) of the splines b_i(θ) [m] of sites (rows, m, 2), for `splines.basis`.

    Each is a share of the least distance to another site over the support of its basis function, which b_i(θ) therefore
    never exceeds.
    """
    rows, m, _ = sites.shape
    places = periodic_interpolation(sites, np.arange(_SAMPLES_PER_ROW * rows) * 2.0 * np.pi / (_SAMPLES_PER_ROW * rows))
    least = np.full((_SAMPLES_PER_ROW * rows, m), np.inf)
    for i in range(m):
        distance = np.linalg.norm(places - places[:, i : i + 1], axis=2)
        distance[:, i] = np.inf
        least[:, i] = distance.min(axis=1)
    # The basis function of control point j is non-zero from two rows before row j − 1 to two rows behind it.
    window = np.arange(-3 * _SAMPLES_PER_ROW, _SAMPLES_PER_ROW + 1)
    around = least[np.mod(_SAMPLES_PER_ROW * np.arange(rows + 3)[:, None] + window, len(least))].min(axis=1)
    return np.minimum(_RADIUS_RATIO * around, _MAX_CORE_RADIUS)
