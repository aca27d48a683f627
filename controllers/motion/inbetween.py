r"""Table of corrections of a blend between its clips: a smooth function of the lap's phase and two blend coordinates.

.. math:: D(\theta, a, b) = \textstyle\sum_{ijk} B_i(\theta)\, B_j(a)\, B_k(b)\, C_{ijk}

Tensor products of uniform cubic B-splines, periodic in θ, natural in a and b. D has two channels for the root and
four for each limb (`ROOT`, `FOOT`): displacements of root and end (foot) in the plane [m], the rise of the end [m], and
its turn about the vertical [rad]. It is zero at the corners, where one clip has all the weight.
"""

import numpy as np
from numba import njit

from controllers.curves.splines import basis, basis_slope, control_points
from geometry.arrays import Array

ROOT, FOOT = 2, 4  # channels: of the root (x, y), of each limb's end (x, y, z, heading)
_ROWS, _NODES, _CHANNELS, _TABLE = range(4)


def packed_table(values: Array) -> Array:
    """Table for `correction` from values (n, nodes, nodes, channels) at equal steps of θ, a and b; nodes ≥ 4."""
    rows, nodes, _, channels = values.shape
    # Second derivatives vanish at the ends.
    system = np.zeros((nodes + 2, nodes + 2))
    for k in range(nodes):
        system[k, k : k + 3] = 1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0
    system[nodes, :3] = system[nodes + 1, -3:] = 1.0, -2.0, 1.0
    inverse = np.linalg.inv(system)[:, :nodes]
    control = np.einsum("ai,bj,nijc->nabc", inverse, inverse, values, optimize=True)
    return np.concatenate([[rows, nodes, channels], control_points(control, np.ones(1)).ravel()])


@njit
def table_channels(table: Array) -> int:
    """Channels of a `packed_table`."""
    return int(table[_CHANNELS])


@njit(forceinline=True)
def correction(table: Array, angle: float, a: float, b: float, d: Array, slopes: bool = True) -> None:
    """Corrections D, and their derivatives if asked for.

    Parameters
    ----------
    table : Array
        `packed_table`.
    angle, a, b : float
        θ in [0, 2π], and coordinates in [0, 1].
    d : Array, shape (4, channels)
        Written: D [m, rad], and its derivatives by θ, a and b, or zeros.
    slopes : bool
        Whether the derivatives are wanted.
    """
    rows, nodes, channels = int(table[_ROWS]), int(table[_NODES]), int(table[_CHANNELS])
    scale, steps = rows / (2.0 * np.pi), nodes - 1
    row, i, j = min(int(angle * scale), rows - 1), min(int(a * steps), steps - 1), min(int(b * steps), steps - 1)
    s, u, v = angle * scale - row, a * steps - i, b * steps - j
    along, along_slope = basis(s), basis_slope(s)
    in_a, in_a_slope, in_b, in_b_slope = basis(u), basis_slope(u), basis(v), basis_slope(v)
    d[:] = 0.0
    for k in range(4):
        w, w_slope = along[k], scale * along_slope[k]
        for m in range(4):
            for n in range(4):
                first = _TABLE + (((row + k) * (nodes + 2) + i + m) * (nodes + 2) + j + n) * channels
                share = in_a[m] * in_b[n]
                by_a, by_b = steps * in_a_slope[m] * in_b[n], steps * in_a[m] * in_b_slope[n]
                values = table[first : first + channels]
                for c in range(channels):
                    d[0, c] += w * share * values[c]
                for c in range(channels if slopes else 0):
                    d[1, c] += w_slope * share * values[c]
                    d[2, c] += w * by_a * values[c]
                    d[3, c] += w * by_b * values[c]
