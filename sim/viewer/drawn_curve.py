"""A curve in a viser scene: a thin rod, and the tube around it."""

from typing import Any

import viser

from geometry.arrays import Array
from sim.viewer.palette import rgb
from sim.viewer.shapes import tube
from sim.viewer.shown import Course

_TUBE_STYLE: dict[str, Any] = {"receive_shadow": False, "opacity": 0.16, "side": "double"}


class DrawnCurve:
    """A course under a scene node; `rod` and `radius` are the drawn radii of rod and tube [m], 0 for no tube."""

    def __init__(self, scene: viser.SceneApi, node: str, course: Course, rod: float, radius: float):
        self._scene, self._meshes = scene, dict[str, viser.MeshHandle]()
        self._parts = [(f"{node}/line", rod, 8, rgb(course.line), dict[str, Any]())]
        if radius > 0.0:
            self._parts.append((f"{node}/tube", radius, 20, rgb(course.tube), _TUBE_STYLE))

    def draw(self, points: Array) -> None:
        """Draw it along points of the scene [m], shape (m, 3)."""
        for node, radius, sides, color, style in self._parts:
            vertices, faces = tube(points, radius, sides)
            mesh = self._meshes.get(node)
            if mesh is not None and len(mesh.vertices) == len(vertices):
                mesh.vertices = vertices.astype("float32")
            else:
                self._meshes[node] = self._scene.add_mesh_simple(
                    node, vertices, faces, color=color, cast_shadow=False, **style
                )
