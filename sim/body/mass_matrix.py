"""The figure's block of the mass matrix M, read where MuJoCo has it: a tree's, so half of its entries are zero."""

from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from controllers.state import Array, IntArray


class MassMatrix(NamedTuple):
    """M of some degrees of freedom of a world, which are coupled to no others.

    Attributes
    ----------
    values : Array
        View of MuJoCo's own, the lower triangle of the world's M by rows, without what is always zero.
    rows, columns, places : IntArray
        Entries of row i that are not always zero, of both triangles, are those from ``rows[i]`` to ``rows[i + 1]``:
        their columns, which increase, and places in `values`.
    where : IntArray
        Place of each entry in `values`, −1 for one that is always zero, shape (n, n).
    """

    values: Array
    rows: IntArray
    columns: IntArray
    places: IntArray
    where: IntArray


@njit
def inertia(mass: MassMatrix, i: int, k: int) -> float:
    """M_ik."""
    place = mass.where[i, k]
    return float(mass.values[place]) if place >= 0 else 0.0


@njit
def inertial_force(mass: MassMatrix, i: int, acceleration: Array, force: float) -> float:
    """F + (M a)_i, summed from left to right."""
    for n in range(mass.rows[i], mass.rows[i + 1]):
        force += float(mass.values[mass.places[n]] * acceleration[mass.columns[n]])
    return force


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData, dofs: slice) -> MassMatrix:
    """M of degrees of freedom of a world, which must outlive it."""
    n = dofs.stop - dofs.start
    where = np.full((n, n), -1, dtype=np.int64)
    for i in range(n):
        first = int(model.M_rowadr[dofs.start + i])
        for place in range(first, first + int(model.M_rownnz[dofs.start + i])):
            k = int(model.M_colind[place]) - dofs.start
            where[i, k] = where[k, i] = place
    row, columns = np.nonzero(where >= 0)
    rows = np.searchsorted(row, np.arange(n + 1)).astype(np.int64)
    return MassMatrix(data.M, rows, columns.astype(np.int64), where[row, columns], where)
