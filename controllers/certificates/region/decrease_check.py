"""Check by interval bounds that a Lyapunov function of `lyapunov` decreases in a whole cell of masses and hands."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from controllers.certificates.interrupts import raise_lost_interrupts
from controllers.certificates.region.intervals import bounds
from controllers.certificates.region.lyapunov import N_PARAMETERS, Axis, Cell, Form, decrease
from geometry.arrays import Array


class Checked(NamedTuple):
    """Result of a check.

    Attributes
    ----------
    cells : int
        Number of parts into which the cell was divided.
    slack : float
        Largest bound on the interpolation error of the matrix within a part [1/s].
    least : float
        Smallest eigenvalue at the corners, minus slack [1/s]; the decrease is proved if this is positive.
    """

    cells: int
    slack: float
    least: float


@raise_lost_interrupts()
def check_form(axis: Axis, form: Form, cell: Cell, counts: tuple[int, int, int, int]) -> Checked:
    """Check that a form decreases in a whole cell, divided into `counts` parts along each parameter.

    On each part the matrix differs from the multilinear interpolation between its corners, entry by entry, by at most
    Σ h_i²/8 sup|∂²/∂z_i²|; the suprema are interval bounds of CasADi's second derivatives over the whole part. The
    interpolation between positive definite matrices is positive definite.
    """
    z = ca.SX.sym("z", N_PARAMETERS + 1)
    a, p = axis.matrix(z), form.matrix(z)
    # The mass μ, the first parameter, is divided geometrically.
    edges = [
        (np.geomspace if i == 0 else np.linspace)(cell.low[i], cell.high[i], counts[i] + 1)
        if cell.high[i] > cell.low[i] else np.array([cell.low[i]] * 2)
        for i in range(N_PARAMETERS)
    ]  # fmt: skip
    parts = np.stack(np.meshgrid(*(np.arange(len(edge) - 1) for edge in edges), indexing="ij"), axis=-1)
    parts = parts.reshape(-1, N_PARAMETERS)
    low, high = (np.stack([edges[i][parts[:, i] + k] for i in range(N_PARAMETERS)], axis=1) for k in (0, 1))
    # A larger lever only lengthens the columns of the forces, so each part uses its largest lever.
    levers = cell.lever(high[:, :1])
    low, high = np.hstack([low, levers]), np.hstack([high, levers])
    checked = [
        _check_parts(decrease(axis, a, axis.pushes(a, z[0], z[N_PARAMETERS], form.units, early), p, form), z, low, high)
        for early in (True, False)
    ]
    return Checked(len(low), max(slack for slack, _ in checked), min(least for _, least in checked))


def _check_parts(rows: list[list[Any]], z: Any, low: Array, high: Array) -> tuple[float, float]:
    """Largest slack over the parts, and smallest value of (smallest eigenvalue at corners − slack)."""
    matrix = ca.vertcat(*(ca.horzcat(*row) for row in rows))
    curvature = np.zeros((len(low), len(rows), len(rows)))
    for i in range(N_PARAMETERS):
        if np.any(high[:, i] > low[:, i]):
            second = ca.jacobian(ca.jacobian(ca.vec(matrix), z[i]), z[i])
            ends = bounds(ca.Function("second", [z], [ca.reshape(second, *matrix.shape)]), low, high)
            curvature += np.maximum(np.abs(ends[0]), np.abs(ends[1])) * (high - low)[:, i, None, None] ** 2 / 8.0
    slack = np.linalg.norm(curvature, axis=(1, 2))
    evaluate = ca.Function("matrix", [z], [matrix])
    least = np.full(len(low), np.inf)
    moving = np.any(high > low, axis=0)
    for choice in np.ndindex(*(1 + moving).tolist()):
        corner = np.where(np.array(choice), high, low)
        blocks = np.array(evaluate.map(len(corner))(corner.T)).reshape(len(rows), len(corner), len(rows))
        blocks = blocks.transpose(1, 0, 2)
        least = np.minimum(least, np.linalg.eigvalsh(0.5 * (blocks + blocks.transpose(0, 2, 1)))[:, 0])
    return float(slack.max()), float((least - slack).min())
