"""Triangle meshes for the viewer: bodies of a MuJoCo model, and the tube around a curve."""

from typing import NamedTuple

import mujoco
import numpy as np
from mjviser.conversions import merge_geoms

from geometry.arrays import Array, IntArray
from models.world.scene import FIGURE, FIRST_HIDDEN_GROUP, ROBOT

# Largest drawn radius of a tube, as a share of the curve's extent: a wider one would hide the inside.
_MAX_TUBE_SHARE = 0.3

_MIN_STEP = 1e-12  # [m] shortest step between two points that has a direction
_MIN_POINT_DISTANCE = 1e-4  # [m] between drawn points of a path
_MIN_NORMAL = 1e-6  # shortest projection of a unit normal that is still used


class Shape(NamedTuple):
    """Triangles that move with a body: its index, vertices (v, 3) in its frame [m], faces (f, 3), colour 0 to 1."""

    body: int
    vertices: Array
    faces: IntArray
    rgba: tuple[float, float, float, float]


def body_prefix(model: mujoco.MjModel) -> str:
    """Name prefix of the body that follows the hand: a robot arm if the world has one, else the figure."""
    return ROBOT if any(model.body(body).name.startswith(ROBOT) for body in range(model.nbody)) else FIGURE


def body_shapes(model: mujoco.MjModel, prefix: str) -> list[Shape]:
    """Visible geometry of the bodies whose names begin with a prefix, one `Shape` per body and colour.

    Parameters
    ----------
    model : mujoco.MjModel
        The model.
    prefix : str
        Prefix of the bodies, such as ``figure/``.
    """
    parts: dict[tuple[int, tuple[float, ...]], list[int]] = {}
    for geom in range(model.ngeom):
        body, material = int(model.geom_bodyid[geom]), int(model.geom_matid[geom])
        if model.geom_group[geom] >= FIRST_HIDDEN_GROUP or not model.body(body).name.startswith(prefix):
            continue
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        parts.setdefault((body, tuple(float(c) for c in rgba)), []).append(geom)
    shapes: list[Shape] = []
    for (body, (red, green, blue, alpha)), geoms in parts.items():
        mesh = merge_geoms(model, geoms)
        shapes.append(Shape(body, np.array(mesh.vertices), np.array(mesh.faces), (red, green, blue, alpha)))
    return shapes


def simplify_shapes(shapes: list[Shape], cell: float) -> list[Shape]:
    """Simplify shapes by vertex clustering: vertices in a cubic cell merge at their mean (Rossignac & Borrel 1993).

    Parameters
    ----------
    shapes : list of Shape
        The originals, left unchanged.
    cell : float
        Width of a cell [m].
    """
    simplified: list[Shape] = []
    for shape in shapes:
        cells, cluster = np.unique(np.floor(shape.vertices / cell).astype(np.int64), axis=0, return_inverse=True)
        cluster = cluster.ravel()
        counts = np.bincount(cluster, minlength=len(cells))
        sums = [np.bincount(cluster, shape.vertices[:, k], minlength=len(cells)) for k in range(3)]
        faces = np.sort(cluster[shape.faces], axis=1), cluster[shape.faces]
        is_triangle = (faces[0][:, 0] != faces[0][:, 1]) & (faces[0][:, 1] != faces[0][:, 2])
        simplified.append(
            shape._replace(vertices=np.stack(sums, axis=1) / counts[:, None], faces=faces[1][is_triangle])
        )
    return simplified


def tube(points: Array, radius: float, sides: int = 20) -> tuple[Array, IntArray]:
    """Surface of the tube around a polyline, without caps; closed if the last point equals the first.

    The rings are oriented by parallel transport, so that the surface does not twist more than the line does.

    Parameters
    ----------
    points : array (n, 3)
        Points of the polyline.
    radius : float
        Radius of the tube, in the unit of the points.
    sides : int
        Corners of a ring.

    Returns
    -------
    vertices : array (n sides, 3)
        Vertices, ring by ring.
    faces : array (2 (n − 1) sides, 3)
        Indices of vertices.
    """
    closed = bool(np.allclose(points[0], points[-1]))
    tangents = np.gradient(points, axis=0)
    if closed:
        tangents[0] = tangents[-1] = points[1] - points[-2]
    tangents = _directions(tangents)
    normal = np.zeros(3)
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rings = np.empty((len(points), sides, 3))
    for ring, point, tangent in zip(rings, points, tangents, strict=True):
        normal = normal - (normal @ tangent) * tangent
        if np.linalg.norm(normal) < _MIN_NORMAL:
            # At the first ring, or where the path turns into the direction of the normal, choose a new normal.
            normal = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        normal /= np.linalg.norm(normal)
        ring[:] = point + radius * (
            np.cos(angles)[:, None] * normal + np.sin(angles)[:, None] * np.cross(tangent, normal)
        )
    first = np.arange(len(points) * sides).reshape(len(points), sides)
    a, b = first[:-1], np.roll(first, -1, axis=1)[:-1]
    c, d = first[1:], np.roll(first, -1, axis=1)[1:]
    faces = np.concatenate([np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)])
    return rings.reshape(-1, 3), faces


def distinct(path: Array) -> Array:
    """The points of a path (n, 3) that are 0.1 mm or more from the one before: tubes through others twist."""
    return path[np.linalg.norm(np.diff(path, axis=0, prepend=path[:1] - 1.0), axis=1) > _MIN_POINT_DISTANCE]


def drawn_radius(points: Array, radius: float) -> float:
    """Radius with which a tube of a radius [m] around points (n, 3) of a curve is drawn [m]: limited by the extent."""
    return min(radius, _MAX_TUBE_SHARE * float(np.max(np.ptp(points, axis=0))))


def _directions(tangents: Array) -> Array:
    """Unit tangents (n, 3); where a path rests or reverses, the previous tangent, or at the start the first one."""
    lengths = np.linalg.norm(tangents, axis=1)
    moving = np.flatnonzero(lengths > _MIN_STEP)
    if len(moving) == 0:
        return np.tile([1.0, 0.0, 0.0], (len(tangents), 1))
    last = np.maximum(np.searchsorted(moving, np.arange(len(tangents)), "right") - 1, 0)
    return tangents[moving[last]] / lengths[moving[last], None]
