r"""Common quadratic Lyapunov function of several linear maps: certifies stability under arbitrary switching.

If P > 0 and A_iᵀ P A_i ≤ ρ² P for every i, then |A x|_P ≤ ρ |x|_P for every A in the convex hull of the maps, since
A ↦ Aᵀ P A is convex. So the state decays as ρ^k under arbitrarily fast switching or blending (Liberzon, *Switching in
Systems and Control*, 2003, section 2.1). Maximising the smallest decrease is a semidefinite program (Boyd et al.,
*Linear Matrix Inequalities in System and Control Theory*, 1994, section 5.1), solved by Clarabel. Its solution is a
candidate, which `contraction` verifies independently.
"""

import warnings
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from threading import get_ident
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from geometry.arrays import Array

_ROUNDING = 10.0  # safety factor of the bound on rounding errors of a product of three matrices and its spectrum


class Common(NamedTuple):
    """A common Lyapunov function.

    Attributes
    ----------
    p : Array
        P, shape (n, n), positive definite.
    rate : float
        ρ, including the bound of rounding errors.
    """

    p: Array
    rate: float


def contraction(p: Array, maps: Sequence[Array]) -> float:
    r"""Upper bound on the largest ρ_i with A_iᵀ P A_i ≤ ρ_i² P; infinite if P is not positive definite.

    With P = L Lᵀ it is the largest singular value of Lᵀ A_i L⁻ᵀ. A bound on the rounding errors, 10 n² ε κ(L) times
    the value, is added, so that ρ < 1 also holds in exact arithmetic.
    """
    if not np.all(np.isfinite(p)) or not np.allclose(p, p.T, rtol=1e-12, atol=0.0):
        return float("inf")
    values = np.linalg.eigvalsh(p)
    if values[0] <= len(p) ** 2 * np.finfo(float).eps * values[-1]:
        return float("inf")
    factor = np.linalg.cholesky(p)
    largest = max(np.linalg.norm(np.linalg.solve(factor, (factor.T @ a).T).T, 2) for a in maps)
    slack = _ROUNDING * len(p) ** 2 * np.finfo(float).eps * np.linalg.cond(factor)
    return float(largest * (1.0 + slack))


def common_lyapunov(maps: Sequence[Array]) -> Common | None:
    """Common quadratic Lyapunov function of stable maps, or None if none was found.

    First the mean of the maps' individual Lyapunov functions is tried. If it does not decrease along all maps, a
    semidefinite program is solved in its coordinates.

    Parameters
    ----------
    maps : sequence of Array
        A_i, shape (n, n) each.
    """
    if max(float(np.abs(np.linalg.eigvals(a)).max()) for a in maps) >= 1.0:
        return None
    # State units in which all components are of similar size; otherwise rates would dominate angles.
    scale = np.sqrt(np.diag(solve_discrete_lyapunov(maps[-1], np.eye(len(maps[-1])))))
    scaled = [a * scale / scale[:, None] for a in maps]
    individual = [solve_discrete_lyapunov(a.T, np.eye(len(a))) for a in scaled]
    mean = np.sum([p / np.linalg.norm(p, 2) for p in individual], axis=0)
    start = np.linalg.cholesky(0.5 * (mean + mean.T))
    # In these coordinates the mean is the identity matrix.
    transformed = [np.linalg.solve(start, (start.T @ a).T).T for a in scaled]
    candidate = np.eye(len(mean))
    if contraction(candidate, transformed) >= 1.0:
        candidate = _optimise_decrease(transformed)
    p = (start @ candidate @ start.T) / np.outer(scale, scale)
    p = 0.5 * (p + p.T)
    rate = contraction(p, maps)
    return Common(p, rate) if rate < 1.0 else None


def _optimise_decrease(maps: Sequence[Array]) -> Array:
    """P of trace n that maximises the decrease t, P − A_iᵀ P A_i ≥ t I; the identity matrix if none is found.

    The maps are stable, so that t > 0 makes P positive definite.
    """
    import cvxpy  # imported late: takes a second, and most certificates do not need it

    problem, p, products = _build_program(len(maps[0]), len(maps), get_ident())
    for product, a in zip(products, maps, strict=True):
        product.value = np.kron(a.T, a.T)
    p.value = None  # if the solver fails, P must not be that of other maps
    with warnings.catch_warnings(), suppress(cvxpy.SolverError):
        warnings.simplefilter("ignore", UserWarning)  # about an inaccurate solution, which is verified later
        problem.solve(solver=cvxpy.CLARABEL, warm_start=False)  # otherwise the solver keeps the scaling of other maps
    return np.eye(len(maps[0])) if p.value is None else 0.5 * (p.value + p.value.T)


@cache
def _build_program(n: int, count: int, thread: int) -> tuple[Any, Any, list[Any]]:
    """The semidefinite program of `count` maps, its P, and its parameters A_iᵀ ⊗ A_iᵀ; compiled for Clarabel once.

    Each thread has its own program, since solving sets the parameters.
    """
    import cvxpy

    p, least = cvxpy.Variable((n, n), symmetric=True), cvxpy.Variable()
    products = [cvxpy.Parameter((n * n, n * n)) for _ in range(count)]
    after = [cvxpy.reshape(product @ cvxpy.vec(p, order="F"), (n, n), order="F") for product in products]
    decrease = [cvxpy.PSD(p - last - least * np.eye(n)) for last in after]
    return cvxpy.Problem(cvxpy.Maximize(least), [*decrease, cvxpy.Zero(cvxpy.trace(p) - n)]), p, products
