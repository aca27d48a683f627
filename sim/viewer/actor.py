"""Drawing of a model's bodies in a viser scene: solid or as a ghost, at true size or magnified."""

import mujoco
import viser

from geometry.arrays import Array
from sim.viewer.palette import TUBE, rgb
from sim.viewer.shapes import Shape

GHOST_OPACITY = 0.35  # 1: opaque


class Actor:
    """Bodies of a model that are drawn in one style and placed by position and quaternion.

    Parameters
    ----------
    scene : viser.SceneApi
        Scene in which they are drawn.
    name : str
        Name of the scene node that holds them.
    shapes : list of Shape
        Shapes of the bodies.
    scale : float
        Magnification.
    ghost : str, optional
        Colour of a translucent ghost, ``#rrggbb``; by default bodies are drawn solid in their own colours.
    """

    def __init__(self, scene: viser.SceneApi, name: str, shapes: list[Shape], scale: float, ghost: str = ""):
        self._root = scene.add_frame(f"/{name}", show_axes=False)
        self._frames: dict[int, viser.FrameHandle] = {}
        for i, shape in enumerate(shapes):
            node = f"/{name}/{shape.body}"
            if shape.body not in self._frames:
                self._frames[shape.body] = scene.add_frame(node, show_axes=False)
            opacity = GHOST_OPACITY if ghost else shape.rgba[3]
            scene.add_mesh_simple(
                f"{node}/{i}", shape.vertices * scale, shape.faces, color=rgb(ghost) if ghost else shape.rgba[:3],
                opacity=None if opacity == 1 else opacity, cast_shadow=not ghost, receive_shadow=False,
            )  # fmt: skip

    def pose(self, data: mujoco.MjData, origin: Array, scale: float, at: Array) -> None:
        """Draw each body at ``at + scale (x − origin)``."""
        for body, frame in self._frames.items():
            frame.position = at + scale * (data.xpos[body] - origin)
            frame.wxyz = data.xquat[body]

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._root.visible

    @visible.setter
    def visible(self, value: bool) -> None:
        self._root.visible = value

    def remove(self) -> None:
        """Remove the bodies from the scene."""
        self._root.remove()


GHOST = TUBE
"""Colour of the ghost of an animation."""
