"""Initial layouts of curves in the half plane (r, z): lattices in a rectangle, and multidimensional scaling."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from controllers.haptic_map.lifting.room import Rectangle
from geometry.arrays import Array


def lattice(rectangle: Rectangle, separation: float) -> Array:
    """Hexagonal lattice of points (k, 2) in a rectangle, each at least the separation from all others [m]."""
    size = rectangle.high - rectangle.low
    best = np.empty((0, 2))
    for axis in (0, 1):
        along, across = size[axis], size[1 - axis]
        rows = int(across / (separation * np.sqrt(0.75)) + 1e-9) + 1
        pitch = across / max(rows - 1, 1)
        points: list[tuple[float, float]] = []
        for row in range(rows):
            offset = 0.5 * separation * (row % 2)
            count = int((along - offset) / separation + 1e-9) + 1 if along >= offset else 0
            points += [(offset + separation * k, row * pitch) for k in range(count)]
        if len(points) > len(best):
            best = np.array(points)[:, :: (1 if axis == 0 else -1)]
    return rectangle.low + best


def scaled(wanted: Array, pace: Array, rectangle: Rectangle) -> Array:
    """Points (n, 2) in a rectangle with nearly the distances wanted, by classical scaling (Torgerson 1952).

    Parameters
    ----------
    wanted : Array, shape (n, n)
        Distances [m].
    pace : Array, shape (n,)
        Angular rate of each clip: among the rotations and reflections of the points, those that fit the rectangle and
        put fast clips at small radii are preferred.
    rectangle : Rectangle
    """
    n = len(wanted)
    middle, half = 0.5 * (rectangle.low + rectangle.high), 0.5 * (rectangle.high - rectangle.low)
    centre = np.eye(n) - 1.0 / n
    values, vectors = np.linalg.eigh(-0.5 * centre @ wanted**2 @ centre)
    plane = np.zeros((n, 2))
    plane[:, : min(n, 2)] = (vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1][:, :2]
    # The signs of eigenvectors are those of the processor's rounding.
    plane *= np.where(plane[np.abs(plane).argmax(axis=0), [0, 1]] < 0.0, -1.0, 1.0)
    lead = (pace - pace.mean()) / max(float(pace.std()), 1e-9) if n > 1 else np.zeros(n)
    best, least = np.tile(middle, (n, 1)), np.inf
    for angle in np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False):
        c, s = np.cos(angle), np.sin(angle)
        for mirror in (1.0, -1.0):
            turned = plane @ np.array([[c, s], [-s * mirror, c * mirror]])
            over = np.maximum(np.abs(turned) - half, 0.0)
            cost = float((over**2).sum() / (half**2).sum() + 0.1 * (lead * turned[:, 0]).mean() / half[0])
            if cost < least - 1e-12:
                best, least = middle + np.clip(turned, -half, half), cost
    return best


def on_lattice(places: Array, rectangle: Rectangle, separation: float) -> Array:
    """Points (n, 2) of the coarsest lattice with room for them, assigned as near as possible to the given ones."""
    n = len(places)
    pitch = float(np.linalg.norm(rectangle.high - rectangle.low))
    # The coarsest lattice that fits, so that the arrangement uses the whole rectangle.
    while len(lattice(rectangle, pitch)) < n and pitch > separation:
        pitch = max(0.95 * pitch, separation)
    points = lattice(rectangle, pitch)
    cost = ((places[:, None] - points) ** 2).sum(axis=2)
    return points[linear_sum_assignment(cost)[1]]
