r"""Contact forces within friction cones, by regularised non-negative least squares whose dual has only six unknowns.

A contact force is a non-negative combination of the edges of its linearised friction cone. The contact forces x that
come nearest to a root wrench b solve

.. math:: \min_{x \ge 0}\ \tfrac12\|b - A x\|^2 + \tfrac12 \sum_j x_j^2 / s_j ,

with a column a_j of A for each edge and its *share* s_j ≥ 0: a point above the floor gets a small share, so that it is
unloaded gradually. The optimality conditions are x_j = s_j max(0, a_jᵀ y) with the residual y = b − A x; they leave

.. math:: y + \sum_j s_j \max(0, a_j^T y)\, a_j = b ,

the stationarity condition of a strictly convex, piecewise quadratic function of y ∈ R⁶. Newton's method with exact
Hessians takes a handful of steps however many edges there are, and y is the wrench that the ground cannot provide.
"""

import numpy as np
from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from sim.body.cholesky import factor, substitute

N_EDGES = 4  # edges of a linearised friction cone
_MAX_NEWTON_STEPS = 40  # a handful is usual
_TOLERANCE = 1e-10  # on the norm of the gradient, in units of b (of order one): far below any residual of interest


@njit
def cone_edges(point: Array, friction: float, edges: Array) -> None:
    """Wrenches about the origin of the four edges of a friction cone at a point, each of unit vertical force.

    Parameters
    ----------
    point : Array
        Point of contact, relative to the origin of moments, shape (3,) [m]; the floor's normal is z.
    friction : float
        Coefficient μ; the edges lie on the round cone along ±x and ±y, and in between the pyramid is inside it. The
        pyramids by which motions are prepared are turned by 45° (`models.mocap.dynamics.floor_forces`).
    edges : Array
        Result, shape (4, 6): force, then moment point × force.
    """
    for e in range(N_EDGES):
        sign = friction if e < 2 else -friction
        fx, fy = (sign, 0.0) if e % 2 == 0 else (0.0, sign)
        edges[e, 0], edges[e, 1], edges[e, 2] = fx, fy, 1.0
        edges[e, 3] = point[1] - point[2] * fy
        edges[e, 4] = point[2] * fx - point[0]
        edges[e, 5] = point[0] * fy - point[1] * fx


@njit
def shared_forces(edges: Array, share: Array, wrench: Array, residual: Array, force: Array) -> int:
    """Forces along cone edges that come as near to a wrench as their shares allow (see the module's equations).

    Parameters
    ----------
    edges : Array
        Aᵀ, shape (n, 6), scaled so that rows and `wrench` are of order one.
    share : Array
        s ≥ 0, shape (n,); an edge without a share carries nothing.
    wrench : Array
        b, shape (6,).
    residual : Array
        y, shape (6,): a guess (the previous solution) on entry, b − A x on return.
    force : Array
        x ≥ 0, shape (n,).

    Returns
    -------
    int
        Newton steps taken, at most `_MAX_NEWTON_STEPS`.
    """
    n = share.size
    H, step, gradient, trial = work_array((6, 6)), work_array(6), work_array(6), work_array(6)
    for taken in range(_MAX_NEWTON_STEPS):
        value = _differentiate_dual(edges, share, wrench, residual, force, H, step)
        norm = 0.0
        for i in range(6):
            norm += step[i] * step[i]
        if norm < _TOLERANCE**2:
            return taken
        gradient[:] = step
        factor(H)
        substitute(H, step)
        slope = -np.dot(gradient, step)
        length = 1.0
        for i in range(6):
            trial[i] = residual[i] - step[i]
        while _dual_value(edges, share, wrench, trial) > value + 1e-4 * length * slope + 1e-15 and length > 1e-6:
            length *= 0.5
            for i in range(6):
                trial[i] = residual[i] - length * step[i]
        residual[:] = trial
    for j in range(n):
        force[j] = share[j] * max(0.0, np.dot(edges[j], residual))
    return _MAX_NEWTON_STEPS


@njit
def _differentiate_dual(
    edges: Array, share: Array, wrench: Array, y: Array, force: Array, H: Array, gradient: Array
) -> float:
    """Value, gradient and generalised Hessian of the dual function at y; leaves x in `force`."""
    value = 0.0
    for i in range(6):
        gradient[i] = y[i] - wrench[i]
        value += y[i] * (0.5 * y[i] - wrench[i])
        for k in range(i):
            H[i, k] = 0.0
        H[i, i] = 1.0
    for j in range(share.size):
        force[j] = 0.0
        if share[j] <= 0.0:
            continue
        edge_residual = 0.0
        for i in range(6):
            edge_residual += edges[j, i] * y[i]
        if edge_residual <= 0.0:
            continue
        force[j] = share[j] * edge_residual
        value += 0.5 * force[j] * edge_residual
        for i in range(6):
            gradient[i] += force[j] * edges[j, i]
            for k in range(i + 1):
                H[i, k] += share[j] * edges[j, i] * edges[j, k]
    return value


@njit
def _dual_value(edges: Array, share: Array, wrench: Array, y: Array) -> float:
    value = 0.0
    for i in range(6):
        value += y[i] * (0.5 * y[i] - wrench[i])
    for j in range(share.size):
        if share[j] > 0.0:
            edge_residual = 0.0
            for i in range(6):
                edge_residual += edges[j, i] * y[i]
            if edge_residual > 0.0:
                value += 0.5 * share[j] * edge_residual * edge_residual
    return value
