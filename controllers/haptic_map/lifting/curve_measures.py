"""Measures of authored curves: separation, curvature, speed, and how well they reproduce the motions' distances."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from controllers.haptic_map.lifting.arrangement_energy import N_ANGLES, Task, evaluate_sites
from controllers.haptic_map.lifting.transitions import Transition
from geometry.arrays import Array


class CurveMeasure(NamedTuple):
    """Measures of one curve, with its clip at its own pace.

    Attributes
    ----------
    radius : float
        Least radius of curvature [m].
    speed, acceleration : float
        Largest of the hand on the curve [m/s, m/s²].
    """

    radius: float
    speed: float
    acceleration: float


class Meeting(NamedTuple):
    """A transition and the geometry of its two curves there.

    Attributes
    ----------
    transition : Transition
    distance : float
        Distance of the curves at its angle [m].
    slant : float
        Angle between the curves' tangents [rad].
    speeds : (float, float)
        Speeds of the hand on either curve [m/s].
    """

    transition: Transition
    distance: float
    slant: float
    speeds: tuple[float, float]


class ArrangementMeasure(NamedTuple):
    """Measures of all curves together.

    Attributes
    ----------
    separation : float
        Least distance of two curves at one angle, at least `TRANSITION_WINDOW` from their transitions [m]; infinite for
        one curve.
    nearest : float
        The same in space: any two points of two curves, both at least `TRANSITION_WINDOW` from their transitions [m].
    stress : float
        Deviation of the curves' distances from those of the poses, at the best scale κ: √(Σ (D − κd)² / Σ D²).
    curves : tuple of CurveMeasure
    meetings : tuple of Meeting
    """

    separation: float
    nearest: float
    stress: float
    curves: tuple[CurveMeasure, ...]
    meetings: tuple[Meeting, ...]


def measure(task: Task, controls: Array) -> ArrangementMeasure:
    """Measure an arrangement of control points (N_ROWS, n, 2)."""
    sites = evaluate_sites(controls)
    q, n = sites[0], sites.shape[2]
    angle = 2.0 * np.pi * np.arange(N_ANGLES) / N_ANGLES
    r, z, c, s = q[..., 0], q[..., 1], np.cos(angle)[:, None], np.sin(angle)[:, None]
    points = np.stack([r * c, r * s, z], axis=-1)
    v, u = (np.moveaxis(part, 0, -1) for part in task.hand_motion(sites))
    speed, pull = np.linalg.norm(v, axis=-1), np.linalg.norm(u, axis=-1)
    bend = np.linalg.norm(np.cross(v, u), axis=-1) / speed**3
    curves = [
        CurveMeasure(float(1.0 / bend[:, i].max()), float(speed[:, i].max()), float(pull[:, i].max())) for i in range(n)
    ]
    distances = np.linalg.norm(q[:, :, None] - q[:, None], axis=-1)
    apart = np.ones((N_ANGLES, n, n), dtype=np.bool_)
    for first, second, near in task.windows():
        apart[:, first, second] &= near >= 1.0
    meetings: list[Meeting] = []
    for at in task.transitions:
        k, i, j = round(at.angle / (2.0 * np.pi) * N_ANGLES) % N_ANGLES, at.first, at.second
        along = float(np.clip(v[k, i] @ v[k, j] / (speed[k, i] * speed[k, j]), -1.0, 1.0))
        meetings.append(
            Meeting(at, float(distances[k, i, j]), float(np.arccos(along)), (float(speed[k, i]), float(speed[k, j])))
        )
    pairs = list(zip(*np.triu_indices(n, 1), strict=True))
    separation = min((float(distances[apart[:, i, j], i, j].min()) for i, j in pairs), default=np.inf)
    nearest = np.inf
    for i, j in pairs:
        keep = apart[:, i, j]
        nearest = min(nearest, float(KDTree(points[keep, j]).query(points[keep, i])[0].min()))
    i, j = np.triu_indices(n, 1)
    d, wanted = distances[:, i, j], task.distance[:, i, j]
    kappa = float((d * wanted).sum() / max(float((wanted**2).sum()), 1e-300))
    stress = float(np.sqrt(((d - kappa * wanted) ** 2).sum() / max(float((d**2).sum()), 1e-300)))
    return ArrangementMeasure(separation, nearest, stress, tuple(curves), tuple(meetings))
