"""Where a foot stands: the places of its contact spheres in a stance, flat on the floor, or turning on one of them.

A person turns on the ball of a foot or on its heel, while the rest is hardly loaded. Four spheres cannot do that: those
that slide have friction against their motion only, and held at one heading, the foot lets the leg twist. A sphere alone
has no moment of friction about the vertical. So while a foot turns under load, it stands on the sphere that moves
least, and the others are lifted (`stances.clearance`). Before and after the turn it lies flat, and that sphere keeps
its place.

As long as feet had one heading in a stance, snu/pirouette, whose foot turns by 275°, was 9.0° RMS from the capture
instead of 3.7, and was followed with 12.3 instead of 7.2 % of weight (docs/validation/preparation-choices.md).
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from models.arrays import Array, Mask
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.motion.spans import cleaned, spans

# Rate [rad/s] and angle [rad] from which a foot turns in its stance: no walk or run among the 28 captures of
# docs/validation/prepared-captures.md has such a turn; other values were not tried.
_TURNING, _TURN = 1.5, np.deg2rad(45.0)
# Vertical load above which something must bear [body weights]: half or twice changes whether a sphere stands in 0.9 %
# or less of the frames of 19 captures.
LOADED = 0.35
# Shortest rest between two turns the same way, or at an end [s], as places are kept for 0.05 s on either side: where
# shorter ones are laid flat dance_a has 4.8 instead of 3.3 % of weight.
_FLAT = 0.1
_SMOOTHING = 0.02  # standard deviation of the filter for the rate [s]
_ENOUGH = 4  # frames in which a foot stands on heel and toes, from which its place is taken there


def place_foot(
    points: Array, yaw: Array, sole: Array, parts: Mask, turning: Sequence[tuple[int, int]],
    standing: Mask, places: Array,
) -> None:  # fmt: skip
    """Write which of a foot's four spheres stand in a stance of n frames, and where.

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
        Frames in which it turns, as `turns` gives them.
    standing : Mask
        Which spheres stand, shape (n, 4): written where the foot turns.
    places : Array
        Their centres on the floor, shape (n, 4, 3) [m]: written.
    """
    after, pivot = 0, None
    for start, end in [*turning, (len(yaw), len(yaw))]:
        if start > after:
            lies = _flat(points[after:start], yaw[after:start], sole, parts[after:start])
            places[after:start] = lies if pivot is None else lies + places[after - 1, pivot] - lies[pivot]
        if end > start:
            ways = np.linalg.norm(np.diff(points[start:end, :, :2], axis=0), axis=2).sum(axis=0)
            pivot = int(np.argmin(ways))
            at = places[start - 1, pivot] if start > after else np.median(points[start:end, pivot], axis=0)
            places[start:end, pivot, :2] = at[:2]
            standing[start:end] = np.arange(4) == pivot
        after = end
    if turning:
        # The places hang together by the pivots; the stance as a whole is put where the capture has it.
        places[:, :, :2] += np.median((points - places)[standing][:, :2], axis=0)


def turns(rate: Array, load: Array, fps: float) -> list[tuple[int, int]]:
    """Frames, from the first to that after the last, in which a standing foot turns by 45° or more under load.

    Parameters
    ----------
    rate : Array
        Its angular velocity about the vertical, shape (n,) [rad/s]. The rate of its heading would not do: that leaps
        where a runner's foot rolls over the toes until its sole is upright.
    load : Array
        Vertical load of the motion, shape (n,) [body weights].
    fps : float
        Frame rate [1/s].
    """
    rate = gaussian_filter1d(rate, _SMOOTHING * fps)
    found: list[tuple[int, int]] = []
    for way in (-1.0, 1.0):
        rests = cleaned(way * rate <= _TURNING, 0, round(_FLAT * fps))
        found += (
            (start, end)
            for start, end in spans(~rests)
            if way * rate[start:end].sum() / fps > _TURN and load[start:end].mean() > LOADED
        )
    found.sort()
    return [turn for k, turn in enumerate(found) if k == 0 or turn[0] >= found[k - 1][1]]


def lying(points: Array, sole: Array, yaw: float, spheres: list[int]) -> Array:
    """Sphere centres of a sole flat on the floor, placed at the median of its spheres over frames, shape (4, 3) [m]."""
    c, s = np.cos(yaw), np.sin(yaw)
    level = sole[:, :2] @ np.array([[c, s], [-s, c]])
    place = np.median(points[:, spheres, :2] - level[spheres], axis=(0, 1))
    return np.column_stack((level + place, np.full(4, CONTACT_RADIUS)))


def _flat(points: Array, yaw: Array, sole: Array, parts: Mask) -> Array:
    """Sphere centres of a foot with one heading over frames, placed by what of it stands longest, shape (4, 3) [m]."""
    heel, toe = parts.T
    if np.sum(heel & toe) >= _ENOUGH:
        frames, spheres = np.logical_and(heel, toe), [0, 1, 2, 3]
    elif toe.sum() >= heel.sum():
        frames, spheres = toe, [2, 3]
    else:
        frames, spheres = heel, [0, 1]
    return lying(points[frames], sole, float(np.median(yaw[frames])), spheres)
