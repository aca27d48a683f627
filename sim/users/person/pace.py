r"""The natural timing of a hand along a given closed path: that of minimum jerk.

.. math:: \min_{s(t)} \int_0^T \left|\frac{d^3}{dt^3} x(s(t))\right|^2 dt

(Todorov & Jordan 1998: smoothness along a predefined path predicts the speed profiles of people.)
"""

import numpy as np
from scipy.optimize import minimize

from geometry.arrays import Array

_N_HARMONICS = 6  # Fourier terms of the logarithm of the speed along a lap


def natural_times(points: Array, seconds: float) -> Array:
    """Times [s], shape (n,), at which a closed path of a given duration passes its points (n, 3).

    The last point must equal the first. The speed along the path is exp of a Fourier series in arc length, whose
    coefficients minimise the jerk.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = np.concatenate(([0.0], np.cumsum(steps)))
    angle = 2.0 * np.pi * length / length[-1]
    waves = np.concatenate([[np.cos(k * angle), np.sin(k * angle)] for k in range(1, _N_HARMONICS + 1)])
    n = len(points) - 1
    even = np.arange(n) / n

    def times(coefficients: Array) -> Array:
        slowness = np.exp(-coefficients @ waves)
        cumulative_time = np.concatenate(([0.0], np.cumsum(0.5 * (slowness[1:] + slowness[:-1]) * steps)))
        return cumulative_time / cumulative_time[-1]

    frequencies = np.fft.fftfreq(n, 1.0 / n)[:, None]

    def jerk(coefficients: Array) -> float:
        at = times(coefficients)
        x = np.stack([np.interp(even, at, points[:, k]) for k in range(points.shape[1])], axis=1)
        # Low frequencies only, since the path between its points is not known.
        spectrum = np.where(np.abs(frequencies) <= 4 * _N_HARMONICS, np.fft.fft(x, axis=0), 0.0)
        return float(np.sum(np.abs(frequencies**3 * spectrum) ** 2))

    initial_jerk = jerk(np.zeros(2 * _N_HARMONICS))

    def relative_jerk(c: Array) -> float:
        return jerk(c) / initial_jerk

    solution = minimize(relative_jerk, np.zeros(2 * _N_HARMONICS), method="L-BFGS-B")
    return seconds * times(solution.x)
