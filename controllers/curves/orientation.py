"""Orientation and angular velocity along a curve, for compiled laws."""

import numpy as np
from numba import njit

from controllers.curves.trajectory import BREAKS, COEFFICIENTS, PIECE, find_piece, wrap_phase
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.rotations import multiply
from geometry.vectors import Quaternion, Vector


@njit
def curve_orientation(blob: Array, at: int, t: float) -> tuple[Quaternion, Vector]:
    """Orientation R_H(t), unit quaternion wxyz, and its angular velocity ω_H [rad/s], of the curve at ``blob[at:]``.

    With s the spline through the quaternions, q = s/|s| and ω = 2 Im(ṡ ⊗ s*)/|s|². Where the phase of an open curve is
    clamped to an end, ω is that at the end, as for `curve_velocity`.
    """
    t = wrap_phase(blob, at, t)
    piece = find_piece(blob, at, t)
    u = t - blob[at + int(blob[at + BREAKS]) + piece]
    row = at + int(blob[at + COEFFICIENTS]) + piece * PIECE + 3
    s, d = work_array(4), work_array(4)
    for k in range(4):
        a, b, c, e = blob[row + k], blob[row + 7 + k], blob[row + 14 + k], blob[row + 21 + k]
        s[k], d[k] = a + u * (b + u * (c + u * e)), b + u * (2.0 * c + 3.0 * u * e)
    square = s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]
    _, x, y, z = multiply(d[0], d[1], d[2], d[3], s[0], -s[1], -s[2], -s[3])
    scale, rate = 1.0 / np.sqrt(square), 2.0 / square
    return (scale * s[0], scale * s[1], scale * s[2], scale * s[3]), (rate * x, rate * y, rate * z)
