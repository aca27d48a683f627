"""How deep legs and arms go into each other or into the trunk, by the shapes of the figure that is drawn."""

from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from models.humanoid.skeleton import figure_model

_TRUNK = ("pelvis", "abdomen", "chest")
_THIGHS = ("left_thigh", "right_thigh")
# Names of two parts of the body, and pairs of segments that touch only where one part is in the other: thighs always
# touch each other, and an upper arm touches the chest.
_PAIRS: tuple[tuple[str, str, tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]], ...] = (
    ("left leg", "right leg", (
        (("left_shank", "left_foot"), ("right_thigh", "right_shank", "right_foot")),
        (("left_thigh",), ("right_shank", "right_foot")),
    )),
    *((f"{side} arm", part, (((f"{side}_forearm", f"{side}_hand"), segments),))
      for side in ("left", "right") for part, segments in (("trunk", _TRUNK), ("legs", _THIGHS))),
)  # fmt: skip
PARTS: tuple[tuple[str, str], ...] = tuple((first, second) for first, second, _ in _PAIRS)
"""Parts of the body whose depth in each other is measured."""

_DRAWN_GROUP = 1  # of the geoms that are drawn; spheres of contact are in another


class Overlaps(NamedTuple):
    """How deep parts of the body are in each other.

    Attributes
    ----------
    depths : array, shape (n, len(PARTS))
        How far the two parts would have to be moved to be apart; 0 where they are [m].
    gradients : array, shape (n, len(PARTS), 57)
        Derivatives of the depths in the tangent of the poses [m/m], [m/rad].
    """

    depths: Array
    gradients: Array


def depths(poses: Array) -> Array:
    """Depth of each of `PARTS` in each other in poses (n, 75), shape (n, len(PARTS)) [m]; 0 where they are apart."""
    return overlaps(poses, np.full(len(PARTS), np.inf)).depths


def overlaps(poses: Array, beyond: Array) -> Overlaps:
    r"""Depths of `PARTS` in poses (n, 75), and gradients of those that exceed `beyond` (len(PARTS),) [m].

    .. math:: \partial d = n \cdot (J_a(p_a) - J_b(p_b)) \, \delta

    where p_a and p_b are the points of two shapes that are deepest in each other, n the direction from p_b to p_a
    divided by the depth d, as MuJoCo's `mj_geomDistance` gives them.
    """
    model, rows = figure_model(), _pairs()
    data, ends, jacobians = mujoco.MjData(model), np.empty(6), np.empty((2, 3, model.nv))
    firsts, seconds = rows[:, 1:].T
    reach = model.geom_rbound[firsts] + model.geom_rbound[seconds]
    found = Overlaps(np.zeros((len(poses), len(PARTS))), np.zeros((len(poses), len(PARTS), model.nv)))
    for k, pose in enumerate(poses):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        near = np.linalg.norm(data.geom_xpos[firsts] - data.geom_xpos[seconds], axis=1) < reach
        deepest: dict[int, tuple[int, int, Array]] = {}
        for part, a, b in rows[near].tolist():
            depth = -mujoco.mj_geomDistance(model, data, a, b, 0.0, ends)
            if depth > found.depths[k, part]:
                found.depths[k, part] = depth
                deepest[part] = a, b, ends.copy()
        for part, (a, b, points) in deepest.items():
            depth = found.depths[k, part]
            if depth <= beyond[part]:
                continue
            mujoco.mj_comPos(model, data)
            for jacobian, geom, point in zip(jacobians, (a, b), points.reshape(2, 3), strict=True):
                mujoco.mj_jac(model, data, jacobian, None, point, int(model.geom_bodyid[geom]))
            found.gradients[k, part] = (points[3:] - points[:3]) / depth @ (jacobians[1] - jacobians[0])
    return found


@cache
def _pairs() -> npt.NDArray[np.intp]:
    """Index in `PARTS` and the two shapes of every pair that is drawn, shape (n, 3)."""
    model = figure_model()
    geoms: dict[str, list[int]] = {}
    for geom in np.flatnonzero(model.geom_group == _DRAWN_GROUP):
        geoms.setdefault(model.body(model.geom_bodyid[geom]).name, []).append(int(geom))
    return np.array([
        (k, a, b)
        for k, (_, _, pairs) in enumerate(_PAIRS)
        for first, second in pairs
        for one in first for other in second for a in geoms[one] for b in geoms[other]
    ])  # fmt: skip
