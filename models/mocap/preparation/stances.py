r"""Contact detection: the contact schedule of a capture, from motion of its soles and from its vertical load.

Heel and toes of a foot stand by the rule of all contacts (`standing_parts`); each stance has one flat place on the
floor, or stands on one sphere while it turns (`foot_places`). Where nothing stands although the centre of mass
accelerates as if under load, the capture skates or hovers: a neighbouring stance is then extended, on the toes if the
stance came before and on the lower part of the foot if it comes after. Without such a stance the lowest part of the
feet bears load while sliding, most of which `root_path` removes before. An open clip with an upright end rests there on
both feet, since nobody can rest on the toes of one, as captures may be cut. Hands are in the schedule of a clip in
which they bear load (`hand_stances`), and only there.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from models.arrays import Array, Mask
from models.gravity import GRAVITY
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, soles
from models.mocap.dynamics.contacts import standing_parts
from models.mocap.dynamics.floor_forces import WITH_HANDS
from models.mocap.dynamics.momentum import momentum
from models.mocap.dynamics.spacetime import LAG
from models.mocap.motion import quaternions
from models.mocap.motion.clip import Clip, global_rotations
from models.mocap.motion.spans import cleaned, spans
from models.mocap.preparation.foot_places import LOADED, lying, place_foot, turns
from models.mocap.preparation.hand_stances import bear_longer, bearing_hands
from models.mocap.preparation.poses import contact_points, sole_points, with_neighbours

# Half or twice of each of the next numbers, down to `_SMOOTHING`, changes whether a sphere stands in 0.9 % or less of
# the frames of 19 captures.
_LOW, _FAR = 0.10, 0.15  # largest height of a foot, and travel of what stands longer, where a stance is extended [m]
_NEAR = 0.015  # spheres within this height of the lowest one bear together [m]
_SMOOTHING = 0.02  # standard deviation of the filter for the load [s]
_SWING = 0.015  # least height of a swinging foot [m]: the tracking controller takes one below 8 mm for standing
# Least height of the other spheres of a foot that turns on one [m]: twice moves the residual of four captures by 0.4 %
# of weight at most.
_LIFT = 0.01
_RISE = 0.08  # time before and after stance in which this height is reached [s]; captured feet swing at 2 to 5 cm
_RESTS = 0.1  # time at both ends of an open clip in which both feet stand [s]
_KEPT = 0.05  # time before and after a stance over which a sphere keeps its place ever less [s]: one knot of `Change`
_UPRIGHT = 0.55  # least height of the root there [m]: a crawling or lying body is supported otherwise
_N_SOLES = len(FOOT_CONTACTS)


class Stances(NamedTuple):
    """Contact schedule of k contact spheres over n frames: the feet's 8, and the palms' 2 where a hand bears load.

    Attributes
    ----------
    standing : array of bool, shape (n, k)
        Whether a sphere rests at its place.
    pushing : array of bool, shape (n, k)
        Whether it may bear load.
    places : array, shape (n, k, 3)
        Target centres of standing spheres [m], on the floor.
    sliding : array of bool, shape (n, k)
        Whether it is on the floor and under load, but not at rest.
    kept : array, shape (n, k)
        Share with which a sphere keeps its place over the floor: 1 in stance, falling to 0 before and after it while
        another stands.
    """

    standing: Mask
    pushing: Mask
    places: Array
    sliding: Mask
    kept: Array

    @property
    def feet(self) -> Mask:
        """Whether each of the feet's spheres rests at its place, shape (n, 8)."""
        return self.standing[:, :_N_SOLES]

    @property
    def hands(self) -> Mask:
        """Whether each palm bears load, shape (n, 2); (n, 0) in the schedule of the feet alone."""
        return self.standing[:, _N_SOLES:]


def stances(clip: Clip, smooth: Clip) -> Stances:
    """The contact schedule of a clip; a closed clip is extended periodically.

    Parameters
    ----------
    clip : Clip
        The clip as captured, since low-pass filters blur contacts.
    smooth : Clip
        The same low-passed, from which the vertical load is computed.
    """
    # A lap to either side: a stance over the seam has one place, however long it is.
    poses, calm, first = with_neighbours(clip, smooth)
    points, fps = contact_points(poses, WITH_HANDS), clip.fps
    parts, hands, load = _support(poses, points, calm, fps)
    if not hands.any():
        points, hands = points[:, :_N_SOLES], hands[:, :0]
    turned = global_rotations(poses)
    standing, places = np.column_stack((_of_spheres(parts), hands)), np.full(points.shape, CONTACT_RADIUS)
    for foot, side in enumerate(("left", "right")):
        mine = slice(4 * foot, 4 * foot + 4)
        own = turned[:, BODIES.index(f"{side}_foot")]
        yaw, rate = (
            np.unwrap(quaternions.heading(own)),
            quaternions.rotated(own, quaternions.velocities(own, fps))[:, 2],
        )
        for start, end in spans(np.any(parts[:, foot], axis=1)):
            stance = slice(start, end)
            turning = turns(rate[stance], load[stance], fps)
            place_foot(
                points[stance, mine], yaw[stance], soles()[mine], parts[stance, foot], turning,
                standing[stance, mine], places[stance, mine],
            )  # fmt: skip
    for palm, bears in enumerate(hands.T, start=_N_SOLES):
        for start, end in spans(bears):
            places[start:end, palm, :2] = np.median(points[start:end, palm, :2], axis=0)
    sliding = np.zeros_like(standing)
    sliding[:, :_N_SOLES] = _slides(points[:, :_N_SOLES], parts, hands, load, fps)
    lag = max(1, round(LAG * fps))
    firm = standing.copy()
    for shift in range(1, lag + 1):
        firm[shift:] &= standing[:-shift]
        firm[:-shift] &= standing[shift:]
    pushing = firm | sliding
    # In frames under load in which nothing else may bear, standing spheres bear without the lag.
    none = ~pushing.any(axis=1) & (load > LOADED)
    pushing[none] |= standing[none]
    kept = _kept(standing, places, round(_KEPT * fps))
    here = slice(first, first + clip.n_frames)
    return Stances(standing[here], pushing[here], places[here], sliding[here] & ~standing[here], kept[here])


def sliding_support(poses: Array, calm: Array, fps: float) -> Mask:
    """Which contact spheres of the feet bear load without resting, shape (n, 8).

    Parameters
    ----------
    poses, calm : Array
        Poses as captured, and low-passed, shape (n, 75).
    fps : float
        Frame rate [1/s].
    """
    points = contact_points(poses, WITH_HANDS)
    return _slides(points[:, :_N_SOLES], *_support(poses, points, calm, fps), fps)


def rested(schedule: Stances, clip: Clip) -> Stances:
    """The contact schedule with both feet flat on the floor at the upright ends of an open clip.

    Parameters
    ----------
    schedule : Stances
        The schedule that `stances` gives.
    clip : Clip
        Its clip.
    """
    if clip.closes():
        return schedule
    standing, pushing, places, sliding, kept = schedule
    made = Stances(standing.copy(), pushing.copy(), places.copy(), sliding.copy(), kept)
    points, turned = sole_points(clip.poses), global_rotations(clip.poses)
    k = round(_RESTS * clip.fps)
    for at, span in ((0, slice(0, k)), (-1, slice(clip.n_frames - k, clip.n_frames))):
        if clip.poses[at, 2] < _UPRIGHT:
            continue
        for foot, side in enumerate(("left", "right")):
            mine = slice(4 * foot, 4 * foot + 4)
            if schedule.standing[at, mine].any():
                place = schedule.places[at, mine]
            else:
                yaw = float(quaternions.heading(turned[at, BODIES.index(f"{side}_foot")]))
                place = lying(points[None, at, mine], soles()[mine], yaw, [0, 1, 2, 3])
            made.places[span, mine] = place
            made.standing[span, mine] = made.pushing[span, mine] = True
            made.sliding[span, mine] = False
    return made._replace(kept=_kept(made.standing, made.places, round(_KEPT * clip.fps)))


def clearance(schedule: Stances, fps: float, closed: bool) -> Array:
    """Least height of each contact sphere in swing phase [m], rising from 0 at stance, shape (n, k).

    The tracking controller would take a foot that swings a few millimetres over the floor for a standing one, and so
    the other spheres of a foot that turns on one. A hand stays above the floor.
    """
    grounded = schedule.standing | schedule.sliding
    n = len(grounded)
    turns = schedule.feet.reshape(n, 2, 4).sum(axis=2) == 1
    laps, turns = (np.tile(of, (3, 1)) if closed else of for of in (grounded, turns))
    here = slice(n, 2 * n) if closed else slice(0, n)
    least = np.zeros(grounded.shape)
    for foot in range(2):
        mine = slice(4 * foot, 4 * foot + 4)
        swings = ~laps[:, mine].any(axis=1)
        height = np.where(swings, _SWING, np.where(turns[:, foot], _LIFT, 0.0))
        for sphere in range(4 * foot, 4 * foot + 4):
            stands = np.flatnonzero(laps[:, sphere])
            if not len(stands):
                continue
            frames = np.arange(len(laps))
            after = np.searchsorted(stands, frames)
            away = np.minimum(
                np.abs(frames - stands[np.minimum(after, len(stands) - 1)]),
                np.abs(frames - stands[np.maximum(after - 1, 0)]),
            )
            risen = height * np.minimum(away / (_RISE * fps), 1.0)
            least[:, sphere] = risen[here]
    return least


def _support(poses: Array, points: Array, calm: Array, fps: float) -> tuple[Mask, Mask, Array]:
    """Stances, extended as the load needs.

    Returns whether heel and toes of each foot stand, (n, 2, 2), whether each hand bears load, (n, 2), and the vertical
    load, (n,).
    """
    soles_at = points[:, :_N_SOLES]
    parts = standing_parts(soles_at, poses[:, :2], fps)
    hands = bearing_hands(points, poses, calm, _of_spheres(parts), fps)
    load = _load(calm, fps)
    if hands.any():
        for start, end in spans(_bare(parts, hands, load, fps)):
            bear_longer(points[:, _N_SOLES:], hands, start, end, _FAR)
    for start, end in spans(_bare(parts, hands, load, fps)):
        _bear(soles_at, parts, start, end)
    return parts, hands, load


def _of_spheres(parts: Mask) -> Mask:
    """Whether each of the feet's spheres stands, as its heel or toes do, (n, 2, 2) → (n, 8)."""
    return np.repeat(parts, 2, axis=2).reshape(len(parts), _N_SOLES)


def _bare(parts: Mask, hands: Mask, load: Array, fps: float) -> Mask:
    """Where nothing stands under load, shape (n,)."""
    stands = parts.any(axis=(1, 2)) | hands.any(axis=1)
    return cleaned(~stands & (load > LOADED), round(0.03 * fps), 2)


def _slides(points: Array, parts: Mask, hands: Mask, load: Array, fps: float) -> Mask:
    """The lowest spheres of the feet where nothing stands under load, shape (n, 8)."""
    heights = points[:, :, 2] - CONTACT_RADIUS
    lowest = heights.min(axis=1, keepdims=True)
    return _bare(parts, hands, load, fps)[:, None] & (heights < lowest + _NEAR) & (lowest < _LOW)


def _bear(points: Array, parts: Mask, start: int, end: int) -> None:
    """Extend a neighbouring stance over frames start to end, in which nothing stands under load, if there is one."""
    span = slice(start, end)
    middles = points[span].reshape(end - start, 2, 2, 2, 3).mean(axis=3)
    heights = middles[..., 2].mean(axis=0) - CONTACT_RADIUS
    for foot in np.argsort(heights.min(axis=1)):
        after = start > 0 and parts[start - 1, foot].any()
        before = end < len(parts) and parts[end, foot].any()
        part = 1 if after else int(np.argmin(heights[foot]))
        way = middles[:, foot, part, :2]
        if heights[foot, part] < _LOW and np.linalg.norm(way - way[0], axis=1).max() < _FAR and (after or before):
            parts[span, foot, part] = True
            return


def _kept(standing: Mask, places: Array, width: int) -> Array:
    """Share with which spheres keep their places; `places` are extended over the frames beside stances."""
    share = standing.astype(np.float64)
    for sphere in range(standing.shape[1]):
        for start, end in spans(standing[:, sphere]):
            for away in range(1, width + 1):
                left = 1.0 - away / (width + 1)
                for at, stance in ((start - away, start), (end - 1 + away, end - 1)):
                    if 0 <= at < len(share) and share[at, sphere] < left:
                        share[at, sphere], places[at, sphere] = left, places[stance, sphere]
    # Nothing holds a foot that leaves into a flight or lands from one: held there, a backflip and a kick fell.
    share[~standing.any(axis=1)] = 0.0
    return share


def _load(poses: Array, fps: float) -> Array:
    """Vertical ground reaction force that the motion needs [body weights], shape (n,)."""
    if len(poses) < 3:
        return np.ones(len(poses))
    height = momentum(Clip(poses, fps, "load")).com[:, 2]
    rising = np.gradient(np.gradient(height)) * fps**2
    return gaussian_filter1d(rising / GRAVITY + 1.0, _SMOOTHING * fps)
