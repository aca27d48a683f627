r"""Smooth saturation at the edge of a domain, with two continuous derivatives.

.. math:: f(x) = x \;(x \le a), \qquad
          f(x) = a + m\,(u - u^3 + \tfrac12 u^4),\; u = \min\Bigl(\frac{x - a}{m}, 1\Bigr) \;(x > a)

f departs from the identity at a with f' = 1 and f'' = 0, and is constant, a + m/2, from a + m on.
"""

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.easing import cubic_step


@njit
def soft_clamp(x: float, low: float, high: float, margin: float) -> tuple[float, float]:
    """A coordinate saturated at an interval, and its derivative: x within, constant from a margin beyond; C²."""
    beyond = max(x - high, low - x)
    if beyond <= 0.0:
        return x, 1.0
    edge, sign = (high, 1.0) if x > high else (low, -1.0)
    u = min(beyond / margin, 1.0)
    # Integral of 1 − S₃(u), which leaves 1 and reaches 0 without a kink.
    return edge + sign * margin * (u - u**3 + 0.5 * u**4), 1.0 - cubic_step(u)


@njit
def saturate_vector(v: Array, inner: float, outer: float, slope: Array) -> None:
    """Shorten a vector (3,) in place to the length f(|v|), at most `outer`; writes its derivative `slope` (3, 3).

    With n = v/|v|: ∂/∂v = (f/|v|) (1 − n nᵀ) + f' n nᵀ.
    """
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    # With a margin of twice the width, the largest length is `outer`.
    value, rate = soft_clamp(length, 0.0, inner, 2.0 * (outer - inner))
    share = value / length if length > inner else 1.0
    square = max(length * length, 1e-300)
    for i in range(3):
        for j in range(3):
            slope[i, j] = (rate - share) * v[i] * v[j] / square + (share if i == j else 0.0)
    for i in range(3):
        v[i] *= share
