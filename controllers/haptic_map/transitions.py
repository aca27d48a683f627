"""Transitions: moments of the common lap at which two motions nearly agree in pose and velocity.

What counts as near is relative (Kovar, Gleicher & Pighin 2002, who compare windows of frames): the distance of the
poses to that of two moments of these motions picked at random, the distance of the velocities to how fast the two
motions are.
"""

from typing import NamedTuple

import numpy as np

from controllers.haptic_map.motion_features import Features, Mask
from controllers.state import Array

SAME = 0.02  # mismatch, on average over the lap, of two clips that are the same motion
_APART = 1.2  # [rad] between two transitions of one clip


class Transition(NamedTuple):
    """Where a hand may change over from one curve to another.

    Attributes
    ----------
    first, second : int
        The clips, first < second.
    angle : float
        θ [rad], 0 to 2π.
    pose, velocity : float
        Relative distances of poses and velocities.
    """

    first: int
    second: int
    angle: float
    pose: float
    velocity: float

    @property
    def mismatch(self) -> float:
        """Root mean square of the relative distances of poses and velocities."""
        return float(np.hypot(self.pose, self.velocity) / np.sqrt(2.0))


class Comparison(NamedTuple):
    """Pairs of motions moment by moment of the lap, at m equal steps of θ.

    Attributes
    ----------
    distance : Array, shape (m, n, n)
        Between poses [m] (see `motion_features`).
    pose, velocity : Array, shape (m, n, n)
        Relative distances; see the module.
    inside : Mask, shape (m, n)
        Whether each clip has a frame there, or is in the gap where an open one returns.
    """

    distance: Array
    pose: Array
    velocity: Array
    inside: Mask

    @property
    def mismatch(self) -> Array:
        """Root mean square of both relative distances, shape (m, n, n)."""
        return np.hypot(self.pose, self.velocity) / np.sqrt(2.0)


def _pairwise(points: Array) -> Array:
    """Distances (m, n, n) between points (m, n, p)."""
    square = (points * points).sum(axis=2)
    both = square[:, :, None] + square[:, None, :] - 2.0 * points @ points.transpose(0, 2, 1)
    return np.sqrt(np.maximum(both, 0.0))


def compare(moments: list[Features], inside: Mask) -> Comparison:
    """Compare motions at equal steps of the common lap.

    Parameters
    ----------
    moments : list of Features
        Of each clip, at the same m angles.
    inside : Mask, shape (m, n)
        See `Comparison`.
    """
    poses = np.stack([each.pose for each in moments], axis=1)
    velocities = np.stack([each.velocity for each in moments], axis=1)
    distance, change = _pairwise(poses), _pairwise(velocities)
    spread = np.sqrt(2.0 * poses.reshape(-1, poses.shape[2]).var(axis=0).sum())
    square = (velocities**2).sum(axis=2).mean(axis=0)
    speed = np.sqrt(square[:, None] + square)
    return Comparison(distance, distance / max(float(spread), 1e-9), change / np.maximum(speed, 1e-9), inside)


def same_motions(compared: Comparison) -> list[tuple[int, int]]:
    """Pairs of clips that hold the same motion all round the lap."""
    mean = compared.mismatch.mean(axis=0)
    return [(i, j) for j in range(len(mean)) for i in range(j) if mean[i, j] < SAME]


def find_transitions(compared: Comparison, most: float) -> list[Transition]:
    """Transitions that can be had together, the best first.

    Candidates are the least mismatches in time of all pairs of clips that are not the same motion. They are taken
    best first, if no transition of either clip is nearer than 1.2 rad, one for each pair.

    Parameters
    ----------
    compared : Comparison
    most : float
        Mismatch up to which poses and velocities nearly agree.
    """
    mismatch = compared.mismatch
    steps, n, _ = mismatch.shape
    same = set(same_motions(compared))
    candidates: list[tuple[float, int, int, int]] = []
    for j in range(n):
        for i in range(j):
            row = np.where(compared.inside[:, i] & compared.inside[:, j], mismatch[:, i, j], np.inf)
            least = (row <= np.roll(row, 1)) & (row < np.roll(row, -1)) & (row <= most)
            if (i, j) not in same:
                candidates += [(float(row[k]), i, j, int(k)) for k in np.flatnonzero(least)]
    taken: list[Transition] = []
    for _, i, j, k in sorted(candidates):
        angle = 2.0 * np.pi * k / steps
        meets = [other for other in taken if {i, j} & {other.first, other.second}]
        near = any(_between(angle, other.angle) < _APART for other in meets)
        if not near and not any((other.first, other.second) == (i, j) for other in meets):
            taken.append(Transition(i, j, angle, float(compared.pose[k, i, j]), float(compared.velocity[k, i, j])))
    return taken


def _between(a: float, b: float) -> float:
    return abs((a - b + np.pi) % (2.0 * np.pi) - np.pi)
