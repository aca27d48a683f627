"""Lowest point of the visible geoms of a body, from their support functions."""

from collections.abc import Sequence

import mujoco
import numpy as np

from geometry.arrays import Array
from models.world.scene import FIRST_HIDDEN_GROUP

_GEOM = mujoco.mjtGeom


def seen_geoms(model: mujoco.MjModel, prefix: str) -> tuple[int, ...]:
    """Visible geoms of the bodies whose names begin with a prefix."""
    return tuple(
        geom
        for geom in range(model.ngeom)
        if model.body(model.geom_bodyid[geom]).name.startswith(prefix) and model.geom_group[geom] < FIRST_HIDDEN_GROUP
    )


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int]) -> float:
    r"""Smallest height of the geoms' surfaces [m], after `mj_kinematics`.

    .. math:: z - h(R^T e_z), \quad h(d) = \max_{x} d \cdot x \text{ over the geom about its own centre}

    with h = r for a sphere, r + ℓ|d_z| for a capsule, ‖s d‖ for an ellipsoid, Σ sᵢ|dᵢ| for a box, r√(1−d_z²) + ℓ|d_z|
    for a cylinder.
    """
    return min(float(data.geom_xpos[g][2]) - _support(model, g, data.geom_xmat[g][6:9]) for g in geoms)


def _support(model: mujoco.MjModel, geom: int, d: Array) -> float:
    """Support of a geom in the direction d of its own frame; of a mesh, which is not symmetric, in the direction −d."""
    kind, s = model.geom_type[geom], model.geom_size[geom]
    if kind == _GEOM.mjGEOM_SPHERE:
        return float(s[0])
    if kind == _GEOM.mjGEOM_CAPSULE:
        return float(s[0] + s[1] * abs(d[2]))
    if kind == _GEOM.mjGEOM_ELLIPSOID:
        return float(np.linalg.norm(s * d))
    if kind == _GEOM.mjGEOM_BOX:
        return float(np.sum(s * np.abs(d)))
    if kind == _GEOM.mjGEOM_CYLINDER:
        return float(s[0] * np.sqrt(max(0.0, 1.0 - d[2] ** 2)) + s[1] * abs(d[2]))
    if kind == _GEOM.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, n = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        return float(-np.min(model.mesh_vert[first : first + n] @ d))
    raise ValueError(f"geom {geom} is of type {kind}, which has no lowest point here")
