"""Cholesky factors of small symmetric positive definite matrices, in place, without calls of LAPACK in a control tick.

`mju_cholFactor` and `mju_cholSolve` give the same result and take 0.60 µs instead of 0.69 for a leg's nine equations,
but they accept neither a block of a larger matrix nor a column of several right-hand sides.
"""

import numpy as np
from numba import njit

from geometry.arrays import Array


@njit
def factor(H: Array) -> None:
    """Replace the lower triangle of a small symmetric positive definite matrix by its Cholesky factor."""
    for i in range(H.shape[0]):
        for j in range(i + 1):
            total = H[i, j]
            for k in range(j):
                total -= H[i, k] * H[j, k]
            H[i, j] = np.sqrt(total) if i == j else total / H[j, j]


@njit
def substitute(L: Array, g: Array) -> None:
    """Solve L Lᵀ z = g in place; g becomes z."""
    n = g.size
    for i in range(n):
        for k in range(i):
            g[i] -= L[i, k] * g[k]
        g[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            g[i] -= L[k, i] * g[k]
        g[i] /= L[i, i]
