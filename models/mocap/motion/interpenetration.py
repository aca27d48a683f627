"""How deep legs and arms go into each other or into the trunk, by the shapes of the figure that is drawn."""

import mujoco
import numpy as np

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


def depths(poses: Array) -> Array:
    """Depth of each of `PARTS` in each other in poses (n, 75), shape (n, len(PARTS)) [m]; 0 where they are apart."""
    model = figure_model()
    data, ends = mujoco.MjData(model), np.empty(6)
    geoms: dict[str, list[int]] = {}
    for geom in np.flatnonzero(model.geom_group == _DRAWN_GROUP):
        geoms.setdefault(model.body(model.geom_bodyid[geom]).name, []).append(int(geom))
    rows = [
        (k, a, b)
        for k, (_, _, pairs) in enumerate(_PAIRS)
        for first, second in pairs
        for one in first for other in second for a in geoms[one] for b in geoms[other]
    ]  # fmt: skip
    parts, firsts, seconds = np.array(rows).T
    reach = model.geom_rbound[firsts] + model.geom_rbound[seconds]
    found = np.zeros((len(poses), len(PARTS)))
    for row, pose in zip(found, poses, strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        near = np.linalg.norm(data.geom_xpos[firsts] - data.geom_xpos[seconds], axis=1) < reach
        for k, a, b in zip(parts[near], firsts[near], seconds[near], strict=True):
            row[k] = max(row[k], -mujoco.mj_geomDistance(model, data, a, b, 0.0, ends))
    return found
