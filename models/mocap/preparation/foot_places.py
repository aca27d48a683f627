"""Foot placement: the places of a foot's contact spheres in a stance, flat on the floor or turning on one of them.

A person turns on the ball of a foot or on its heel, while the rest of the foot is hardly loaded. Four spheres cannot do
that: friction on those that slide only opposes their motion, and if the foot is held at one heading, the leg twists. A
single sphere has no moment of friction about the vertical. So while a foot turns under load, it stands on the sphere
that moves least, and the others are lifted (`stances.clearance`). Before and after the turn it lies flat, and that
sphere keeps its place.

With one heading a stance, snu/pirouette, whose foot turns by 275°, would be 9.0° RMS from the capture instead of 3.7°,
and its residual when tracked 12.3 % of body weight instead of 7.2 % (docs/validation/preparation-choices.md).
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from geometry.arrays import Array, Mask
from geometry.spans import cleaned, spans
from models.humanoid.skeleton import CONTACT_RADIUS

# Rate [rad/s] and angle [rad] above which a foot turns in its stance. No walk or run among the 28 captures of
# docs/validation/prepared-captures.md has such a turn; other values were not tried.
_MIN_TURN_RATE, _MIN_TURN_ANGLE = 1.5, np.deg2rad(45.0)
# Vertical load above which something must bear it [body weights]. Half or twice the value changes whether a sphere
# stands in at most 0.9 % of the frames of 19 captures.
MIN_LOAD = 0.35
# Shortest time for which a foot lies flat between two turns in the same direction, or at an end of the stance [s]:
# places are kept for 0.05 s on either side. If shorter ones are allowed, dance_a has a residual of 4.8 % of body weight
# instead of 3.3 %.
_MIN_FLAT_TIME = 0.1
_SMOOTHING = 0.02  # standard deviation of the Gaussian filter for the rate [s]
_MIN_FLAT_FRAMES = 4  # frames on both heel and toes that suffice to take the place of a foot from these frames alone


def place_foot(
    points: Array, yaw: Array, sole: Array, parts: Mask, turning: Sequence[tuple[int, int]],
    standing: Mask, places: Array,
) -> None:  # fmt: skip
    """Determine which of a foot's four spheres stand in a stance of n frames, and where; written in place.

    Parameters
    ----------
    points : Array
        Centres of the spheres in the capture, shape (n, 4, 3) [m].
    yaw : Array
        Heading of the foot, continuous, shape (n,) [rad].
    sole : Array
        Centres of the spheres in the frame of the foot, shape (4, 3) [m].
    parts : Mask
        Whether heel and toes stand, shape (n, 2).
    turning : sequence of (int, int)
        Frames in which it turns, from `foot_turns`.
    standing : Mask
        Which spheres stand, shape (n, 4): written where the foot turns.
    places : Array
        Their centres on the floor, shape (n, 4, 3) [m]: written.
    """
    last_end, pivot = 0, None
    for start, end in [*turning, (len(yaw), len(yaw))]:
        if start > last_end:
            flat = _flat_place(points[last_end:start], yaw[last_end:start], sole, parts[last_end:start])
            places[last_end:start] = flat if pivot is None else flat + places[last_end - 1, pivot] - flat[pivot]
        if end > start:
            path_lengths = np.linalg.norm(np.diff(points[start:end, :, :2], axis=0), axis=2).sum(axis=0)
            pivot = int(np.argmin(path_lengths))
            pivot_place = places[start - 1, pivot] if start > last_end else np.median(points[start:end, pivot], axis=0)
            places[start:end, pivot, :2] = pivot_place[:2]
            standing[start:end] = np.arange(4) == pivot
        last_end = end
    if turning:
        # The pivots fix the places relative to each other; the stance as a whole is moved to where the capture has it.
        places[:, :, :2] += np.median((points - places)[standing][:, :2], axis=0)


def foot_turns(rate: Array, load: Array, fps: float) -> list[tuple[int, int]]:
    """Spans (first frame, frame after the last) in which a standing foot turns by 45° or more under load.

    Parameters
    ----------
    rate : Array
        Its angular velocity about the vertical, shape (n,) [rad/s]; not the rate of its heading, which jumps where a
        runner's foot rolls over the toes until its sole is upright.
    load : Array
        Vertical load of the motion, shape (n,) [body weights].
    fps : float
        Frame rate [1/s].
    """
    rate = gaussian_filter1d(rate, _SMOOTHING * fps)
    found: list[tuple[int, int]] = []
    for direction in (-1.0, 1.0):
        at_rest = cleaned(direction * rate <= _MIN_TURN_RATE, 0, round(_MIN_FLAT_TIME * fps))
        found += (
            (start, end)
            for start, end in spans(~at_rest)
            if direction * rate[start:end].sum() / fps > _MIN_TURN_ANGLE and load[start:end].mean() > MIN_LOAD
        )
    found.sort()
    return [turn for k, turn in enumerate(found) if k == 0 or turn[0] >= found[k - 1][1]]


def flat_sole(points: Array, sole: Array, yaw: float, spheres: list[int]) -> Array:
    """Sphere centres of a sole flat on the floor, placed at the median of its spheres over frames, shape (4, 3) [m]."""
    c, s = np.cos(yaw), np.sin(yaw)
    level = sole[:, :2] @ np.array([[c, s], [-s, c]])
    place = np.median(points[:, spheres, :2] - level[spheres], axis=(0, 1))
    return np.column_stack((level + place, np.full(4, CONTACT_RADIUS)))


def _flat_place(points: Array, yaw: Array, sole: Array, parts: Mask) -> Array:
    """Sphere centres of a foot with one heading, placed by the part of it that stands longest, shape (4, 3) [m]."""
    heel, toe = parts.T
    if np.sum(heel & toe) >= _MIN_FLAT_FRAMES:
        frames, spheres = np.logical_and(heel, toe), [0, 1, 2, 3]
    elif toe.sum() >= heel.sum():
        frames, spheres = toe, [2, 3]
    else:
        frames, spheres = heel, [0, 1]
    return flat_sole(points[frames], sole, float(np.median(yaw[frames])), spheres)
