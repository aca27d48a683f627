"""Overlay of recorded takes: a translucent figure and the stylus's path for each."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
import viser

from geometry.arrays import Array
from sim.viewer.actor import Actor
from sim.viewer.live_stage import GHOST_AT, GHOST_CELL, drawn_at
from sim.viewer.palette import RIVERS, rgb
from sim.viewer.shapes import body_shapes, distinct, simplify_shapes, tube

COLORS = RIVERS[1:]


class TakeGhosts:
    """Ghosts of takes.

    Parameters
    ----------
    scene : viser.SceneApi
        Scene in which they are drawn.
    model : mujoco.MjModel
        The world with the figure.
    paths : Mapping
        Paths of the stylus by name of the take, in H [m], shapes (n, 3).
    """

    def __init__(self, scene: viser.SceneApi, model: mujoco.MjModel, paths: Mapping[str, Array]):
        self._model, self._data = model, mujoco.MjData(model)
        self._root = int(model.jnt_qposadr[model.joint("figure/root").id])
        shapes = simplify_shapes(body_shapes(model, "figure/"), GHOST_CELL)
        self._ghosts: list[Actor] = []
        self._paths: list[viser.MeshHandle] = []
        for k, (path, color) in enumerate(zip(paths.values(), COLORS, strict=False)):
            self._ghosts.append(Actor(scene, f"take/{k}", shapes, 1.0, color))
            if len(points := distinct(path)) > 1:
                vertices, faces = tube(drawn_at(points), 0.008, sides=8)
                self._paths.append(scene.add_mesh_simple(f"/take/path/{k}", vertices, faces, color=rgb(color)))

    def show(self, poses: Sequence[Array]) -> None:
        """Show a pose (75,) of each take; all takes are drawn at the place of the ghost."""
        for ghost, pose in zip(self._ghosts, poses, strict=False):
            self._data.qpos[self._root : self._root + len(pose)] = pose
            mujoco.mj_kinematics(self._model, self._data)
            ghost.pose(self._data, np.zeros(3), 1.0, GHOST_AT)

    def remove(self) -> None:
        """Remove figures and paths from the scene."""
        for drawn in (*self._ghosts, *self._paths):
            drawn.remove()
