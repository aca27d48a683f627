"""Outlines of the figure in a drawing: parallel projection of its geoms, drawn from back to front."""

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from geometry.arrays import Array
from models.humanoid.skeleton import figure_model
from models.world.scene import FIRST_HIDDEN_GROUP

Paint = Callable[[str, Array], str | tuple[float, ...]]
"""Colour of a geom, from the name of its body and its colour in the model (4,)."""

_N_CORNERS = 28  # of an outline


def model_colour(body: str, rgba: Array) -> tuple[float, ...]:
    """The geom's own colour."""
    return tuple(rgba)


class Outline(NamedTuple):
    """Outline of a geom: its body, colour in the model (4,), depth from the viewer and corners (n, 2) [m]."""

    body: str
    rgba: Array
    depth: float
    corners: Array


class Silhouettes:
    """Outlines of poses of the default figure."""

    def __init__(self) -> None:
        self._model = figure_model()
        self._data = mujoco.MjData(self._model)

    def outlines(self, pose: Array, azimuth: float) -> list[Outline]:
        r"""Outlines of a pose viewed along an azimuth [rad], relative to the position of the root.

        An ellipsoid with semi-axes s and rotation R projects to the ellipse of A Aᵀ, A = P R diag(s) with P the 2 × 3
        projection; a capsule to the hull of two discs.
        """
        model, data = self._model, self._data
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        c, s = np.cos(azimuth), np.sin(azimuth)
        projection, depth = np.array([[s, -c, 0.0], [0.0, 0.0, 1.0]]), np.array([c, s, 0.0])
        origin = np.array([pose[0], pose[1], 0.0])
        result: list[Outline] = []
        for geom in range(model.ngeom):
            if model.geom_group[geom] >= FIRST_HIDDEN_GROUP:
                continue
            centre, turn = data.geom_xpos[geom] - origin, data.geom_xmat[geom].reshape(3, 3)
            size = model.geom_size[geom]
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
                corners = _capsule(projection @ (size[1] * turn[:, 2]), float(size[0]))
            else:
                axes = size if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_ELLIPSOID else np.full(3, size[0])
                corners = _circle() @ np.linalg.cholesky((projection @ turn * axes**2) @ (projection @ turn).T).T
            body = model.body(model.geom_bodyid[geom]).name
            result.append(Outline(body, model.geom_rgba[geom], float(depth @ centre), projection @ centre + corners))
        return sorted(result, key=lambda outline: -outline.depth)

    def draw(
        self, ax: Axes, pose: Array, at: tuple[float, float], scale: float = 1.0, azimuth: float = 0.0,
        paint: Paint = model_colour,
    ) -> None:  # fmt: skip
        """Draw a pose with its root above a point of the axes, with `scale` units of the axes per metre."""
        for outline in self.outlines(pose, azimuth):
            color = paint(outline.body, outline.rgba)
            corners = np.asarray(at) + scale * outline.corners
            ax.add_patch(Polygon(corners, facecolor=color, edgecolor="white", linewidth=0.25, zorder=3.0))


def _circle() -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, _N_CORNERS, endpoint=False)
    return np.column_stack((np.cos(angle), np.sin(angle)))


def _capsule(half: Array, radius: float) -> Array:
    """Hull of two discs at ±half, shape (n, 2)."""
    start = np.arctan2(half[1], half[0]) - 0.5 * np.pi
    angle = start + np.linspace(0.0, np.pi, _N_CORNERS // 2)
    cap = radius * np.column_stack((np.cos(angle), np.sin(angle)))
    return np.concatenate((half + cap, -half - cap))
