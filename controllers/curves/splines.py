"""Uniform cubic B-splines round a lap: C², interpolating samples, four control points at every phase."""

import numpy as np
from numba import njit

from geometry.arrays import Array


@njit
def basis(u: float) -> tuple[float, float, float, float]:
    """Weights of the four control points of an interval at u in [0, 1]; their sum is 1."""
    v = 1.0 - u
    b0, b1, b3 = v * v * v / 6.0, (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0, u * u * u / 6.0
    return b0, b1, 1.0 - b0 - b1 - b3, b3


@njit
def basis_slope(u: float) -> tuple[float, float, float, float]:
    """Derivatives of the four weights by u; their sum is 0."""
    v = 1.0 - u
    d0, d1, d3 = -0.5 * v * v, 1.5 * u * u - 2.0 * u, 0.5 * u * u
    return d0, d1, -d0 - d1 - d3, d3


@njit
def interpolate(rows: Array, stride: int, u: float, rate: float, value: Array, slope: Array) -> None:
    """Channels between the second and the third of four rows of control points, at u in [0, 1], and their derivatives.

    Parameters
    ----------
    rows : Array
        The rows, one after the other; channel k of row j is at ``rows[j * stride + k]``.
    stride : int
        Distance between two rows.
    u, rate : float
        Place in the interval, and du/dx for derivatives by x.
    value, slope : Array, shape (channels,)
        Written.
    """
    b0, b1, b2, b3 = basis(u)
    d0, d1, d2, d3 = basis_slope(u)
    n = value.shape[0]
    p0, p1 = rows[:n], rows[stride : stride + n]
    p2, p3 = rows[2 * stride : 2 * stride + n], rows[3 * stride : 3 * stride + n]
    for k in range(n):
        value[k] = b0 * p0[k] + b1 * p1[k] + b2 * p2[k] + b3 * p3[k]
        slope[k] = rate * (d0 * p0[k] + d1 * p1[k] + d2 * p2[k] + d3 * p3[k])


def periodic_interpolation(samples: Array, angles: Array) -> Array:
    """Values at angles (...) [rad] of the periodic C² splines through samples (n, ...) at equal steps of the lap."""
    from scipy.interpolate import CubicSpline  # here: a field is evaluated, and a certificate verified, without it

    around = np.concatenate([samples, samples[:1]])
    spline = CubicSpline(np.linspace(0.0, 2.0 * np.pi, len(around)), around, bc_type="periodic")
    return spline(np.mod(angles, 2.0 * np.pi))


def control_points(samples: Array, signs: Array) -> Array:
    """Control points of the splines that interpolate samples at equal steps of the lap.

    Parameters
    ----------
    samples : Array, shape (n, ...)
    signs : Array
        1 where the lap closes, −1 where it returns with the opposite sign (as a quaternion may); broadcasts.

    Returns
    -------
    Array, shape (n + 3, ...)
        Rows k to k + 3 belong to the interval from sample k to the next.
    """
    n = len(samples)
    # Over two laps everything is periodic, and (c₋₁ + 4 c₀ + c₁)/6 = sample is a circular convolution.
    response = (4.0 + 2.0 * np.cos(np.pi * np.arange(n + 1) / n)) / 6.0
    spectrum = np.fft.rfft(np.concatenate([samples, signs * samples]), axis=0)
    spectrum /= response.reshape(-1, *[1] * (samples.ndim - 1))
    control = np.fft.irfft(spectrum, 2 * n, axis=0)
    return np.concatenate([control[-1:], control[: n + 2]])
