r"""Smooth saturation: what leaves a domain is led back onto its edge, with two continuous derivatives.

.. math:: f(r) = r \;(r \le a), \qquad
          f(r) = a + (b - a)\,\frac{x}{(1 + x^3)^{1/3}},\; x = \frac{r - a}{b - a} \;(r > a)

f leaves the identity at a with f' = 1 and f'' = 0, increases, and tends to b.
"""

import numpy as np
from numba import njit

from controllers.state import Array


@njit
def saturated(r: float, inner: float, outer: float) -> tuple[float, float]:
    """f(r) and f'(r) of a length r ≥ 0, for 0 < inner < outer."""
    if r <= inner:
        return r, 1.0
    width = outer - inner
    x = (r - inner) / width
    root = np.cbrt(1.0 + x**3)
    return inner + width * x / root, root**-4


@njit
def saturate_vector(v: Array, inner: float, outer: float, slope: Array) -> None:
    """Shorten a vector (3,) in place to the length f(|v|); `slope` (3, 3) is written: the derivative by it.

    With n = v/|v|: ∂/∂v = (f/|v|) (1 − n nᵀ) + f' n nᵀ.
    """
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    value, rate = saturated(length, inner, outer)
    share = value / length if length > inner else 1.0
    square = max(length * length, 1e-300)
    for i in range(3):
        for j in range(3):
            slope[i, j] = (rate - share) * v[i] * v[j] / square + (share if i == j else 0.0)
    for i in range(3):
        v[i] *= share
