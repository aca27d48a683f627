"""The figure's block of the mass matrix M, read in place from MuJoCo's sparse storage.

The figure is a kinematic tree, so half of the entries of M are always zero.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from geometry.arrays import Array, IntArray


class MassMatrix(NamedTuple):
    """M of those degrees of freedom of a world that are not coupled to any others.

    Attributes
    ----------
    values : Array
        View of MuJoCo's `MjData.M`: the lower triangle of the world's M by rows, without structural zeros.
    rows, columns, places : IntArray
        The full symmetric matrix by compressed rows: entries ``rows[i]`` to ``rows[i + 1]`` of `columns` and `places`
        are the columns of row i, increasing, and their indices in `values`.
    where : IntArray
        Index of each entry in `values`, −1 for a structural zero, shape (n, n).
    """

    values: Array
    rows: IntArray
    columns: IntArray
    places: IntArray
    where: IntArray


@njit
def inertia(mass: MassMatrix, i: int, k: int) -> float:
    """The entry M_ik."""
    place = mass.where[i, k]
    return float(mass.values[place]) if place >= 0 else 0.0


@njit
def inertial_force(mass: MassMatrix, i: int, acceleration: Array, force: float) -> float:
    """F + (M a)_i, summed from left to right so that the rounding is reproducible."""
    for n in range(mass.rows[i], mass.rows[i + 1]):
        force += float(mass.values[mass.places[n]] * acceleration[mass.columns[n]])
    return force


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData, dofs: slice) -> MassMatrix:
    """M of the degrees of freedom `dofs` of a world, which must outlive the result."""
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
