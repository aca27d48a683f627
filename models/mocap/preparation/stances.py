r"""Contact detection: the contact schedule of a capture, from the motion of its soles and from its vertical load.

Heel and toes of a foot stand by the rule for all contacts (`standing_parts`); each stance has one flat place on the
floor, or stands on one sphere while it turns (`foot_places`). Where nothing stands although the centre of mass
accelerates as if under load, the capture skates or hovers: a neighbouring stance is then extended, on the toes if the
stance came before and on the lower part of the foot if it comes after. Without such a stance the lowest part of the
feet bears load while it slides as captured; `root_path` removes most such cases beforehand. An open clip with an
upright end rests there on both feet: captures may be cut anywhere, but nobody can rest on the toes of one foot. Hands
are in the schedule only of clips in which they bear load (`hand_stances`).
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from geometry import quaternions
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY
from geometry.spans import cleaned, spans
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, soles
from models.mocap.dynamics.contacts import standing_parts
from models.mocap.dynamics.floor_forces import ALL_CONTACTS
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import contact_points, global_rotations, sole_points
from models.mocap.preparation.foot_places import MIN_LOAD, flat_sole, foot_turns, place_foot
from models.mocap.preparation.hand_stances import extend_hand_stances, loaded_hands
from models.mocap.preparation.poses import with_neighbours

LOAD_DELAY = 0.012  # a sphere stands for this time before and after it bears load [s]: no force without contact
# Half or twice any of the next values, down to `_LOAD_SMOOTHING`, changes whether a sphere stands in at most 0.9 % of
# the frames of 19 captures.
# Largest height and travel of a part over which its stance is extended [m].
_MAX_EXTENDED_HEIGHT, _MAX_EXTENDED_TRAVEL = 0.10, 0.15
_SHARED_LOAD_HEIGHT = 0.015  # spheres within this height of the lowest one share the load [m]
_LOAD_SMOOTHING = 0.02  # standard deviation of the Gaussian filter for the load [s]
# Least height of a swinging foot [m]: the tracking controller takes one below 8 mm for standing.
_SWING_CLEARANCE = 0.015
# Least height of the other spheres of a foot that turns on one [m]: twice the value changes the residuals of four
# captures by at most 0.4 % of body weight.
_PIVOT_CLEARANCE = 0.01
# Time before and after stance in which this height is reached [s]; captured feet swing at 2 to 5 cm.
_CLEARANCE_TIME = 0.08
_REST_TIME = 0.1  # time at both ends of an open clip in which both feet stand [s]
# Time before and after a stance over which the hold on its place fades [s]: one knot of `Change`.
_HOLD_FADE_TIME = 0.05
# Least height of the root at such an end [m]: a crawling or lying body is supported differently.
_MIN_UPRIGHT_HEIGHT = 0.55
_FILLED_GAP_TIME = 0.03  # support for less than this within a span without support does not divide the span [s]
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
        Target centres of standing spheres [m], on the floor; of sliding ones below where they were captured.
    sliding : array of bool, shape (n, k)
        Whether it is on the floor and under load, but not at rest.
    kept : array, shape (n, k)
        Weight with which a sphere is held at its place over the floor: 1 in stance and while it slides, falling to 0
        before and after a stance while another sphere stands.
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
        The same clip, low-passed, from which the vertical load is computed.
    """
    # With a lap before and after: a stance across the seam has one place, however long it is.
    poses, calm, first = with_neighbours(clip, smooth)
    points, fps = contact_points(poses, ALL_CONTACTS), clip.fps
    parts, hands, load = _find_stances(poses, points, calm, fps)
    if not hands.any():
        points, hands = points[:, :_N_SOLES], hands[:, :0]
    rotations = global_rotations(poses)
    standing, places = np.column_stack((_sphere_mask(parts), hands)), np.full(points.shape, CONTACT_RADIUS)
    for foot, side in enumerate(("left", "right")):
        spheres = slice(4 * foot, 4 * foot + 4)
        foot_rotations = rotations[:, BODIES.index(f"{side}_foot")]
        yaw = np.unwrap(quaternions.heading(foot_rotations))
        rate = quaternions.rotated(foot_rotations, quaternions.velocities(foot_rotations, fps))[:, 2]
        for start, end in spans(np.any(parts[:, foot], axis=1)):
            stance = slice(start, end)
            turning = foot_turns(rate[stance], load[stance], fps)
            place_foot(
                points[stance, spheres], yaw[stance], soles()[spheres], parts[stance, foot], turning,
                standing[stance, spheres], places[stance, spheres],
            )  # fmt: skip
    for palm, bears in enumerate(hands.T, start=_N_SOLES):
        for start, end in spans(bears):
            places[start:end, palm, :2] = np.median(points[start:end, palm, :2], axis=0)
    sliding = np.zeros_like(standing)
    sliding[:, :_N_SOLES] = _sliding_spheres(points[:, :_N_SOLES], parts, hands, load, fps)
    lag = max(1, round(LOAD_DELAY * fps))
    firm = standing.copy()
    for shift in range(1, lag + 1):
        firm[shift:] &= standing[:-shift]
        firm[:-shift] &= standing[shift:]
    pushing = firm | sliding
    # In frames under load in which nothing else may bear it, standing spheres bear load without the lag.
    unsupported = ~pushing.any(axis=1) & (load > MIN_LOAD)
    pushing[unsupported] |= standing[unsupported]
    sliding &= ~standing
    kept = _hold_weights(standing, sliding, places, round(_HOLD_FADE_TIME * fps))
    places[sliding, :2] = points[sliding, :2]
    frames = slice(first, first + clip.n_frames)
    return Stances(standing[frames], pushing[frames], places[frames], sliding[frames], kept[frames])


def sliding_spheres(poses: Array, calm: Array, fps: float) -> Mask:
    """Which contact spheres of the feet bear load without resting, shape (n, 8).

    Parameters
    ----------
    poses, calm : Array
        Poses as captured, and low-passed, shape (n, 75).
    fps : float
        Frame rate [1/s].
    """
    points = contact_points(poses, ALL_CONTACTS)
    return _sliding_spheres(points[:, :_N_SOLES], *_find_stances(poses, points, calm, fps), fps)


def with_feet_at_rest(schedule: Stances, clip: Clip) -> Stances:
    """The contact schedule with both feet flat on the floor at the upright ends of an open clip.

    Parameters
    ----------
    schedule : Stances
        The schedule from `stances`.
    clip : Clip
        Its clip.
    """
    if clip.closes():
        return schedule
    standing, pushing, places, sliding, kept = schedule
    result = Stances(standing.copy(), pushing.copy(), places.copy(), sliding.copy(), kept)
    points, rotations = sole_points(clip.poses), global_rotations(clip.poses)
    k = round(_REST_TIME * clip.fps)
    for frame, frames in ((0, slice(0, k)), (-1, slice(clip.n_frames - k, clip.n_frames))):
        if clip.poses[frame, 2] < _MIN_UPRIGHT_HEIGHT:
            continue
        for foot, side in enumerate(("left", "right")):
            spheres = slice(4 * foot, 4 * foot + 4)
            if schedule.standing[frame, spheres].any():
                place = schedule.places[frame, spheres]
            else:
                yaw = float(quaternions.heading(rotations[frame, BODIES.index(f"{side}_foot")]))
                place = flat_sole(points[None, frame, spheres], soles()[spheres], yaw, [0, 1, 2, 3])
            result.places[frames, spheres] = place
            result.standing[frames, spheres] = result.pushing[frames, spheres] = True
            result.sliding[frames, spheres] = False
    width = round(_HOLD_FADE_TIME * clip.fps)
    return result._replace(kept=_hold_weights(result.standing, result.sliding, result.places, width))


def clearance(schedule: Stances, fps: float, closed: bool) -> Array:
    """Least height of each contact sphere in swing phase [m], rising from 0 at stance, shape (n, k).

    The tracking controller would take a foot that swings a few millimetres above the floor for a standing one; the same
    holds for the other spheres of a foot that turns on one. A hand only stays above the floor.
    """
    grounded = schedule.standing | schedule.sliding
    n = len(grounded)
    turns = schedule.feet.reshape(n, 2, 4).sum(axis=2) == 1
    laps, turns = (np.tile(mask, (3, 1)) if closed else mask for mask in (grounded, turns))
    lap = slice(n, 2 * n) if closed else slice(0, n)
    least = np.zeros(grounded.shape)
    for foot in range(2):
        spheres = slice(4 * foot, 4 * foot + 4)
        swinging = ~laps[:, spheres].any(axis=1)
        height = np.where(swinging, _SWING_CLEARANCE, np.where(turns[:, foot], _PIVOT_CLEARANCE, 0.0))
        for sphere in range(4 * foot, 4 * foot + 4):
            stance = np.flatnonzero(laps[:, sphere])
            if not len(stance):
                continue
            frames = np.arange(len(laps))
            after = np.searchsorted(stance, frames)
            distance = np.minimum(
                np.abs(frames - stance[np.minimum(after, len(stance) - 1)]),
                np.abs(frames - stance[np.maximum(after - 1, 0)]),
            )
            risen_height = height * np.minimum(distance / (_CLEARANCE_TIME * fps), 1.0)
            least[:, sphere] = risen_height[lap]
    return least


def _find_stances(poses: Array, points: Array, calm: Array, fps: float) -> tuple[Mask, Mask, Array]:
    """Stances, extended where the load requires it.

    Returns whether heel and toes of each foot stand, (n, 2, 2), whether each hand bears load, (n, 2), and the vertical
    load, (n,).
    """
    soles_at = points[:, :_N_SOLES]
    parts = standing_parts(soles_at, poses[:, :2], fps)
    hands = loaded_hands(points, poses, calm, _sphere_mask(parts), fps)
    load = _vertical_load(calm, fps)
    if hands.any():
        for start, end in spans(_is_unsupported(parts, hands, load, fps)):
            extend_hand_stances(points[:, _N_SOLES:], hands, start, end, _MAX_EXTENDED_TRAVEL)
    for start, end in spans(_is_unsupported(parts, hands, load, fps)):
        _extend_stance(soles_at, parts, start, end)
    return parts, hands, load


def _sphere_mask(parts: Mask) -> Mask:
    """Whether each of the feet's spheres stands, from whether heel and toes do, (n, 2, 2) → (n, 8)."""
    return np.repeat(parts, 2, axis=2).reshape(len(parts), _N_SOLES)


def _is_unsupported(parts: Mask, hands: Mask, load: Array, fps: float) -> Mask:
    """Whether nothing stands although the body is under load, shape (n,)."""
    supported = parts.any(axis=(1, 2)) | hands.any(axis=1)
    return cleaned(~supported & (load > MIN_LOAD), round(_FILLED_GAP_TIME * fps), 2)


def _sliding_spheres(points: Array, parts: Mask, hands: Mask, load: Array, fps: float) -> Mask:
    """Whether each of the feet's spheres is one of the lowest where nothing stands under load, shape (n, 8)."""
    heights = points[:, :, 2] - CONTACT_RADIUS
    lowest = heights.min(axis=1, keepdims=True)
    return (
        _is_unsupported(parts, hands, load, fps)[:, None]
        & (heights < lowest + _SHARED_LOAD_HEIGHT)
        & (lowest < _MAX_EXTENDED_HEIGHT)
    )


def _extend_stance(points: Array, parts: Mask, start: int, end: int) -> None:
    """Extend a neighbouring stance, if there is one, over frames start to end, in which nothing stands under load."""
    span = slice(start, end)
    middles = points[span].reshape(end - start, 2, 2, 2, 3).mean(axis=3)
    heights = middles[..., 2].mean(axis=0) - CONTACT_RADIUS
    for foot in np.argsort(heights.min(axis=1)):
        after = start > 0 and parts[start - 1, foot].any()
        before = end < len(parts) and parts[end, foot].any()
        part = 1 if after else int(np.argmin(heights[foot]))
        travel = middles[:, foot, part, :2]
        if (
            heights[foot, part] < _MAX_EXTENDED_HEIGHT
            and np.linalg.norm(travel - travel[0], axis=1).max() < _MAX_EXTENDED_TRAVEL
            and (after or before)
        ):
            parts[span, foot, part] = True
            return


def _hold_weights(standing: Mask, sliding: Mask, places: Array, width: int) -> Array:
    """Weights with which spheres are held at their places; `places` are extended over the frames beside stances."""
    weights = standing.astype(np.float64)
    for sphere in range(standing.shape[1]):
        for start, end in spans(standing[:, sphere]):
            for distance in range(1, width + 1):
                weight = 1.0 - distance / (width + 1)
                for frame, stance in ((start - distance, start), (end - 1 + distance, end - 1)):
                    if 0 <= frame < len(weights) and weights[frame, sphere] < weight:
                        weights[frame, sphere], places[frame, sphere] = weight, places[stance, sphere]
    # A foot that takes off into a flight or lands from one is not held: otherwise the figure fell in a backflip and a
    # kick.
    weights[~standing.any(axis=1)] = 0.0
    weights[sliding] = 1.0
    return weights


def _vertical_load(poses: Array, fps: float) -> Array:
    """Vertical ground reaction force that the motion needs [body weights], shape (n,)."""
    if len(poses) < 3:
        return np.ones(len(poses))
    height = momentum(Clip(poses, fps, "load")).com[:, 2]
    rising = np.gradient(np.gradient(height)) * fps**2
    return gaussian_filter1d(rising / GRAVITY + 1.0, _LOAD_SMOOTHING * fps)
