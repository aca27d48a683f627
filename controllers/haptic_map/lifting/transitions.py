"""Transitions: moments of the common lap at which two motions nearly agree in pose, velocity and standing feet.

Distances are relative: that of poses to the distance between two random moments of these motions, that of velocities to
the speeds of the two motions; that of the feet is the fraction of feet that bear load in only one of the motions. As in
motion graphs (Kovar, Gleicher & Pighin 2002) windows of frames are compared, about as long as a hand takes to change
over: a walking figure can break into a run where its feet are in step for a while, but falls where two poses agree by
chance for a moment.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.errors import ParameterError
from controllers.haptic_map.lifting.motion_features import Features
from geometry.arrays import Array, IntArray, Mask

SAME_POSE_DISTANCE = 0.02  # mean mismatch over the lap up to which two clips count as the same motion
# [rad] least distance between two transitions of one clip. With half of it backflip has transitions to both jump and
# walk, 63° apart, and the condition number of h_* is up to 132 instead of 81; twice changes nothing.
_MIN_ANGLE_APART = 1.2
# [s] time before and after a transition over which motions are compared. With half of it the transition of walk and run
# is at 317° instead of 311°, with twice at 338°; the condition number of h_* is up to 77 and 82 instead of 81.
_WINDOW_TIME = 0.2
# [m/s] between two gaits in step: a figure that changes over (`sim.reference.cross_track`) accelerates by 1.8 m/s².
# Between seven pairs of gaits 0.9 to 2.2 m/s apart it stands; from a walk into a sprint, 4.1 m/s apart, it falls.
_MAX_SPEED_CHANGE = 2.5


class Transition(NamedTuple):
    """A moment at which a hand may change over from one curve to another.

    Attributes
    ----------
    first, second : int
        The clips, first < second.
    angle : float
        θ [rad], 0 to 2π.
    pose, velocity, support : float
        Relative distances of poses, velocities and standing feet, RMS over the window.
    speeds : tuple of two floats
        Speeds of the root in the two motions, mean over the window [m/s].
    """

    first: int
    second: int
    angle: float
    pose: float
    velocity: float
    support: float
    speeds: tuple[float, float]


class MapTransition(NamedTuple):
    """Part of a `Transition` that is stored with a lifted map.

    Attributes
    ----------
    first, second : int
        Numbers of the clips.
    angle : float
        θ [rad].
    pose, velocity : float
        Relative distances of the poses and of the velocities.
    """

    first: int
    second: int
    angle: float
    pose: float
    velocity: float


class Comparison(NamedTuple):
    """Comparison of all pairs of motions at m equal steps of θ.

    Attributes
    ----------
    distance : Array, shape (m, n, n)
        Between poses [m] (see `motion_features`).
    pose, velocity, support : Array, shape (m, n, n)
        Relative distances; see the module.
    speed : Array, shape (m, n)
        Speed of the root [m/s].
    inside : Mask, shape (m, n)
        True where a clip has frames, False in the gap where an open one returns.
    laps : Array, shape (n,)
        Duration of a lap of each clip [s].
    """

    distance: Array
    pose: Array
    velocity: Array
    support: Array
    speed: Array
    inside: Mask
    laps: Array

    def window(self, i: int, j: int) -> IntArray:
        """Steps, relative to a moment, of the window in which two clips are compared."""
        reach = round(_WINDOW_TIME / float(self.laps[[i, j]].mean()) * len(self.pose))
        return np.arange(-reach, reach + 1)


def _pairwise_distances(points: Array) -> Array:
    """Distances (m, n, n) between points (m, n, p)."""
    square = (points * points).sum(axis=2)
    both = square[:, :, None] + square[:, None, :] - 2.0 * points @ points.transpose(0, 2, 1)
    return np.sqrt(np.maximum(both, 0.0))


def compare(moments: list[Features], inside: Mask, laps: Array) -> Comparison:
    """Compare motions at equal steps of the common lap.

    Parameters
    ----------
    moments : list of Features
        Features of each clip at the same m angles.
    inside, laps
        See `Comparison`.
    """
    poses = np.stack([each.pose for each in moments], axis=1)
    velocities = np.stack([each.velocity for each in moments], axis=1)
    support = np.stack([each.support for each in moments], axis=1)
    distance, change = _pairwise_distances(poses), _pairwise_distances(velocities)
    unequal_support = _pairwise_distances(support) / np.sqrt(max(support.shape[2], 1))
    spread = np.sqrt(2.0 * poses.reshape(-1, poses.shape[2]).var(axis=0).sum())
    square = (velocities**2).sum(axis=2).mean(axis=0)
    speed = np.sqrt(square[:, None] + square)
    return Comparison(
        distance, distance / max(float(spread), 1e-9), change / np.maximum(speed, 1e-9), unequal_support,
        np.linalg.norm(velocities[:, :, :3], axis=2), inside, laps,
    )  # fmt: skip


def same_motions(compared: Comparison) -> list[tuple[int, int]]:
    """Pairs of clips with the same motion all round the lap."""
    mean = np.hypot(compared.pose, compared.velocity).mean(axis=0) / np.sqrt(2.0)
    return [(i, j) for j in range(len(mean)) for i in range(j) if mean[i, j] < SAME_POSE_DISTANCE]


def find_transitions(compared: Comparison, most: float, strides: Sequence[int] = ()) -> list[Transition]:
    """A compatible set of transitions, the best first.

    Candidates are the local minima of the mismatch over the lap, of all pairs of clips that are not the same motion.
    They are taken greedily, best first, one for each pair, if no transition of either clip is nearer than 1.2 rad.
    Two gaits in step need not agree: what lies between them is a gait, through which a figure can change over.

    Parameters
    ----------
    compared : Comparison
    most : float
        Mismatch up to which two motions nearly agree: RMS of the three relative distances over the window.
    strides : sequence of int
        Number of strides of each gait in a lap, 0 for other clips; by default there are no gaits.
    """
    steps, n, _ = compared.pose.shape
    same = set(same_motions(compared))
    candidates: list[tuple[float, Transition]] = []
    for j in range(n):
        for i in range(j):
            if (i, j) in same:
                continue
            around = (np.arange(steps)[:, None] + compared.window(i, j)) % steps
            parts = [part[:, i, j][around] for part in (compared.pose, compared.velocity, compared.support)]
            means = np.sqrt([np.square(part).mean(axis=1) for part in parts])
            row = np.sqrt(np.square(means).mean(axis=0))
            row[~(compared.inside[:, i] & compared.inside[:, j])] = np.inf
            bound = np.inf if _in_step(compared, strides, i, j) else most
            minima = (row <= np.roll(row, 1)) & (row < np.roll(row, -1)) & (row <= bound) & np.isfinite(row)
            for k in np.flatnonzero(minima):
                pose, velocity, support = (float(value) for value in means[:, k])
                here, there = (float(value) for value in compared.speed[around[k]][:, [i, j]].mean(axis=0))
                angle = 2.0 * np.pi * float(k) / steps
                candidates.append((float(row[k]), Transition(i, j, angle, pose, velocity, support, (here, there))))
    taken: list[Transition] = []
    for _, candidate in sorted(candidates):
        meets = [other for other in taken if {candidate.first, candidate.second} & {other.first, other.second}]
        near = any(_angle_between(candidate.angle, other.angle) < _MIN_ANGLE_APART for other in meets)
        if not near and not any(other[:2] == candidate[:2] for other in meets):
            taken.append(candidate)
    return taken


def _in_step(compared: Comparison, strides: Sequence[int], i: int, j: int) -> bool:
    """Whether two clips are gaits with equal numbers of strides in a lap, between whose speeds a figure can change."""
    speeds = compared.speed[:, [i, j]].mean(axis=0)
    return bool(strides) and strides[i] == strides[j] > 0 and abs(speeds[1] - speeds[0]) < _MAX_SPEED_CHANGE


def _angle_between(a: float, b: float) -> float:
    return abs((a - b + np.pi) % (2.0 * np.pi) - np.pi)


def transition_rows(transitions: Sequence[MapTransition] | Array) -> Array:
    """Transitions as rows (k, 5)."""
    return np.array(transitions, dtype=np.float64) if len(transitions) else np.zeros((0, len(MapTransition._fields)))


def checked_transitions(transitions: Sequence[MapTransition] | Array, clips: int) -> tuple[MapTransition, ...]:
    """Transitions between clips 0 to `clips` − 1, or their rows (k, 5), checked.

    Raises
    ------
    ParameterError
        If a number is not finite, or there is no such clip.
    """
    array = transition_rows(transitions)
    if array.ndim != 2 or array.shape[1] != 5 or not np.isfinite(array).all():
        raise ParameterError(f"transitions must be finite and of shape (k, 5), got {array.shape}")
    if not np.isin(array[:, :2], np.arange(clips)).all():
        raise ParameterError(f"transitions are between clips 0 to {clips - 1}, got {array[:, :2].tolist()}")
    return tuple(MapTransition(int(first), int(second), *rest) for first, second, *rest in array.tolist())
