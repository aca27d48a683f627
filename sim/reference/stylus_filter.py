r"""The tracking filter between stylus and figure: critically damped, of second degree, for position and orientation.

A fading-memory filter (Morrison 1969, *Introduction to Sequential Smoothing and Prediction*): predict with constant
acceleration over the period T, then correct by the residual r with the gains 1 − θ³, 3/2 (1 − θ)² (1 + θ)/T and
(1 − θ)³/T². Constant acceleration, of a translation or of a rotation about a fixed axis, is tracked without lag.

On a lap the hand's acceleration is not constant but turns with the hand: along a circle at the rate Ω the jerk is
−Ω² ṗ. A filter that neglects this jerk gives a velocity 1.6 % too small on the default circle at 2.2 s a lap, so that
the reference moves faster than its stated velocity. So the prediction is that of a coordinated turn (Bar-Shalom, Li and
Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*, 11.7), to third order in T:

.. math:: j = -\Omega^2 \dot p, \qquad \Omega = \min(|\dot p \times \ddot p| \,/\, (\dot p^2 + v_0^2),\ 2\pi)

Without the bound 2π the noise of a slow hand rotates the prediction: the run in LEADING then falls at 7.9 s.
"""

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.rotations import exponential, logarithm, multiply, relative

_NOISE_SPEED = 0.02  # v₀ [m/s]: below this speed the direction of motion is encoder noise
_MAX_TURN_RATE = 2.0 * np.pi  # [rad/s]: no lap takes less than a second; faster turning of a slow hand is noise


@njit
def filter_gains(smoothing: float, period: float) -> tuple[float, float, float]:
    """Gains of the residual on the value [1], its rate [1/s] and its second derivative [1/s²]."""
    rest = 1.0 - smoothing
    return 1.0 - smoothing**3, 1.5 * rest**2 * (1.0 + smoothing) / period, rest**3 / period**2


@njit
def smooth_hand(hand: Array, measured: Array, smoothing: float, period: float) -> None:
    """Advance position, velocity and acceleration, rows of `hand` (3, 3), by one period to a measured position (3,)."""
    g, h, k = filter_gains(smoothing, period)
    turn = turn_rate(hand[1], hand[2])
    for i in range(3):
        jerk = -(turn**2) * hand[1, i]
        predicted = hand[0, i] + period * (hand[1, i] + period * (0.5 * hand[2, i] + period * jerk / 6.0))
        speed = hand[1, i] + period * (hand[2, i] + 0.5 * period * jerk)
        residual = measured[i] - predicted
        hand[0, i] = predicted + g * residual
        hand[1, i] = speed + h * residual
        hand[2, i] += period * jerk + k * residual


@njit
def turn_rate(v: Array, a: Array) -> float:
    """Rate Ω [rad/s] at which the velocity of a hand turns, from its velocity and acceleration, shape (3,) each."""
    x, y, z = v[1] * a[2] - v[2] * a[1], v[2] * a[0] - v[0] * a[2], v[0] * a[1] - v[1] * a[0]
    rate = np.sqrt(x * x + y * y + z * z) / (v[0] ** 2 + v[1] ** 2 + v[2] ** 2 + _NOISE_SPEED**2)
    return min(rate, _MAX_TURN_RATE)


@njit
def extrapolate_orientation(q: Array, turning: Array, s: float) -> tuple[float, float, float, float]:
    """Orientation R·exp(s ω + ½ s² α) after s seconds of the turning (ω, α), shape (2, 3), in the frame of R."""
    a, b = s, 0.5 * s**2
    turn = exponential(
        a * turning[0, 0] + b * turning[1, 0],
        a * turning[0, 1] + b * turning[1, 1],
        a * turning[0, 2] + b * turning[1, 2],
    )
    return multiply(q[0], q[1], q[2], q[3], turn[0], turn[1], turn[2], turn[3])


@njit
def smooth_turn(q: Array, turning: Array, measured: Array, smoothing: float, period: float) -> None:
    r"""Advance orientation and turning by one period to a measured orientation; the residual is a rotation vector.

    .. math:: r = \log(\hat R^{-1} R_{measured}), \qquad R = \hat R \exp(g\,r)

    The residual of a stylus that keeps its orientation is exactly zero, so its orientation is passed on bit for bit.

    Parameters
    ----------
    q : Array
        R_H, unit quaternion wxyz, shape (4,); updated.
    turning : Array
        ω [rad/s] and α [rad/s²] in the frame of R, shape (2, 3); updated.
    measured : Array
        Unit quaternion of either sign, shape (4,).
    smoothing, period : float
        θ and T [s].
    """
    g, h, k = filter_gains(smoothing, period)
    w, x, y, z = extrapolate_orientation(q, turning, period)
    sign = 1.0 if w * measured[0] + x * measured[1] + y * measured[2] + z * measured[3] >= 0.0 else -1.0
    # Difference first, then product: for nearly equal quaternions this loses no digits, for equal ones it is exactly 0.
    rest = (sign * measured[0] - w, sign * measured[1] - x, sign * measured[2] - y, sign * measured[3] - z)
    scalar, a, b, c = relative(w, x, y, z, rest[0], rest[1], rest[2], rest[3])
    r = logarithm(1.0 + scalar, a, b, c)
    correction = exponential(g * r[0], g * r[1], g * r[2])
    q[0], q[1], q[2], q[3] = multiply(w, x, y, z, correction[0], correction[1], correction[2], correction[3])
    for i in range(3):
        turning[0, i] += period * turning[1, i] + h * r[i]
        turning[1, i] += k * r[i]
