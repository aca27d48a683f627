r"""Which parts of the soles stand when and where: the contact schedule of a capture, from its soles and its load.

Heel and toes of a foot stand while they are near the floor and slow; one flat place is taken for a whole stance. Toes
at rest stand with the heels. Where nothing stands but the centre of mass accelerates as if
something did, captures slide or hover: the stance next to it lasts longer, on its toes after it and on what is lower
before it; where there is none, the lowest part of the feet bears, and slides. What ends upright rests on both feet: on
the toes of one, as captures are cut, nobody stays.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from models.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.clip import Clip, global_rotations
from models.mocap.dynamics.floor_forces import soles
from models.mocap.dynamics.momentum import momentum
from models.mocap.preparation.poses import around, sole_points

Mask = npt.NDArray[np.bool_]

# Chosen on eight captures (../shared/prepare-prototype.md): ±1 cm and ±0.1 m/s move the residual by less than 1 point.
_REACH = 0.045  # a part of a sole that stands is lower than this [m] ...
_SLOW, _SHARE = 0.55, 0.3  # ... and slower [m/s], or than this share of the root's speed: legs slide with their length
_LOW = 0.10  # toes that rest beside a standing heel, or a foot that bears though it seems not to stand, are lower [m]
_REST, _FAR = 0.15, 0.15  # ... and slower [m/s]; and it is not further from where it stands [m]
_GAP, _SHORT = 0.05, 0.06  # gaps shorter than this are filled, stances shorter than this dropped [s]
_LAG = 0.012  # a sphere stands this long before and after it pushes [s]
_LOADED = 0.35  # of body weight, above which something must bear
_NEAR = 0.015  # over the lowest sphere [m]: they bear together
_SMOOTHING = 0.02  # of the load [s]
_SWING = 0.015  # least height of a swinging foot [m]: what tracks takes one below 8 mm for standing ...
_RISE = 0.08  # ... reached so long before and after it stands [s]; captured feet swing at 2 to 5 cm
_RESTS = 0.1  # at both ends of an open clip [s], in which both feet stand ...
_UPRIGHT = 0.55  # ... where the root is higher than this [m]: who crawls or lies bears on something else
_GRAVITY = 9.81


class Stances(NamedTuple):
    """What the 8 contact spheres do in n frames.

    Attributes
    ----------
    standing : array of bool, shape (n, 8)
        At rest at their places.
    pushing : array of bool, shape (n, 8)
        May bear load.
    places : array, shape (n, 8, 3)
        Where the centres of standing spheres belong [m]; level on the floor.
    sliding : array of bool, shape (n, 8)
        On the floor and under load, but not at rest.
    """

    standing: Mask
    pushing: Mask
    places: Array
    sliding: Mask


def stances(clip: Clip, smooth: Clip) -> Stances:
    """The contact schedule of a clip; of a closed one as it goes on over its ends.

    Parameters
    ----------
    clip : Clip
        As captured: filters wash contacts out.
    smooth : Clip
        The same without noise, from which the load is told.
    """
    closed = clip.closes()
    if closed:
        margin = min(clip.n_frames, round(clip.fps))
        poses, first = around(clip, margin)
        calm, _ = around(smooth, margin)
    else:
        poses, calm, first = clip.poses, smooth.poses, 0
    points, fps = sole_points(poses), clip.fps
    parts = _parts(points, np.linalg.norm(np.gradient(poses[:, :2], axis=0), axis=1) * fps, fps)
    load = _load(calm, fps)
    for start, end in _runs(_cleaned(~parts.any(axis=(1, 2)) & (load > _LOADED), round(0.03 * fps), 2)):
        _bear(points, parts, start, end)
    turned = global_rotations(poses)
    standing, places = np.repeat(parts, 2, axis=2).reshape(len(points), 8), np.full(points.shape, CONTACT_RADIUS)
    for foot, side in enumerate(("left", "right")):
        mine = slice(4 * foot, 4 * foot + 4)
        _place(points[:, mine], turned[:, BODIES.index(f"{side}_foot")], soles()[mine], parts[:, foot], places[:, mine])
    bare = _cleaned(~standing.any(axis=1) & (load > _LOADED), round(0.03 * fps), 2)
    heights = points[:, :, 2] - CONTACT_RADIUS
    lowest = heights.min(axis=1, keepdims=True)
    sliding = bare[:, None] & (heights < lowest + _NEAR) & (lowest < _LOW)
    lag = max(1, round(_LAG * fps))
    firm = standing.copy()
    for shift in range(1, lag + 1):
        firm[shift:] &= standing[:-shift]
        firm[:-shift] &= standing[shift:]
    pushing = firm | sliding
    # Next to a stretch in which nothing pushes, standing spheres push to their very ends.
    none = ~pushing.any(axis=1) & (load > _LOADED)
    pushing[none] |= standing[none]
    here = slice(first, first + clip.n_frames)
    return Stances(standing[here], pushing[here], places[here], sliding[here] & ~standing[here])


def rested(schedule: Stances, clip: Clip) -> Stances:
    """The contact schedule of an open clip whose ends are at rest on both feet, flat where they are.

    Parameters
    ----------
    schedule : Stances
        As `stances` tells it.
    clip : Clip
        Whose it is.
    """
    if clip.closes():
        return schedule
    standing, pushing, places, sliding = schedule
    made = Stances(standing.copy(), pushing.copy(), places.copy(), sliding.copy())
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
                yaw = float(_heading(turned[at, BODIES.index(f"{side}_foot")]))
                place = _lying(points[None, at, mine], soles()[mine], yaw, [0, 1, 2, 3])
            made.places[span, mine] = place
            made.standing[span, mine] = made.pushing[span, mine] = True
            made.sliding[span, mine] = False
    return made


def clearance(schedule: Stances, fps: float, closed: bool) -> Array:
    """Least heights of the parts of the feet that swing [m], rising from where they stand, shape (n, 8).

    A foot that swings a few millimetres over the floor is taken for a standing one by whatever follows the motion.
    """
    grounded = schedule.standing | schedule.sliding
    n = len(grounded)
    laps = np.tile(grounded, (3, 1)) if closed else grounded
    here = slice(n, 2 * n) if closed else slice(0, n)
    least = np.zeros((n, 8))
    for foot in range(2):
        mine = slice(4 * foot, 4 * foot + 4)
        swings = ~laps[:, mine].any(axis=1)
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
            risen = np.where(swings, _SWING, 0.0) * np.minimum(away / (_RISE * fps), 1.0)
            least[:, sphere] = risen[here]
    return least


def _parts(points: Array, pace: Array, fps: float) -> Mask:
    """Which of heel and toes of left and right foot stand, shape (n, 2, 2)."""
    middles = points.reshape(len(points), 2, 2, 2, 3).mean(axis=3)
    heights = middles[..., 2] - CONTACT_RADIUS
    speeds = np.linalg.norm(np.gradient(middles, axis=0), axis=3) * fps
    stands = (heights < _REACH) & (speeds < np.maximum(_SLOW, _SHARE * pace)[:, None, None])
    stands[:, :, 1] |= stands[:, :, 0] & (heights[:, :, 1] < _LOW) & (speeds[:, :, 1] < _REST)
    for foot in range(2):
        for part in range(2):
            stands[:, foot, part] = _cleaned(stands[:, foot, part], round(_GAP * fps), round(_SHORT * fps))
    return stands


def _bear(points: Array, parts: Mask, start: int, end: int) -> None:
    """Let a stance last over frames start to end in which nothing stands though something bears, where one is near."""
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


def _place(points: Array, turned: Array, sole: Array, parts: Mask, places: Array) -> None:
    """Write one foot's places: one flat one for each stance."""
    heel, toe = parts.T
    yaw = np.unwrap(_heading(turned))
    for start, end in _runs(heel | toe):
        span = np.arange(start, end)
        flat = span[heel[span] & toe[span]]
        if len(flat) >= 4:
            frames, spheres = flat, [0, 1, 2, 3]
        elif toe[span].sum() >= heel[span].sum():
            frames, spheres = span[toe[span]], [2, 3]
        else:
            frames, spheres = span[heel[span]], [0, 1]
        places[start:end] = _lying(points[frames], sole, float(np.median(yaw[frames])), spheres)


def _heading(turned: Array) -> Array:
    """Of a foot's own forward axis about the vertical [rad]."""
    x = 1.0 - 2.0 * (turned[..., 2] ** 2 + turned[..., 3] ** 2)
    y = 2.0 * (turned[..., 1] * turned[..., 2] + turned[..., 0] * turned[..., 3])
    return np.arctan2(y, x)


def _lying(points: Array, sole: Array, yaw: float, spheres: list[int]) -> Array:
    """A sole flat on the floor, its spheres where they are in the median of frames, shape (4, 3)."""
    c, s = np.cos(yaw), np.sin(yaw)
    level = sole[:, :2] @ np.array([[c, s], [-s, c]])
    place = np.median(points[:, spheres, :2] - level[spheres], axis=(0, 1))
    return np.column_stack((level + place, np.full(4, CONTACT_RADIUS)))


def _load(poses: Array, fps: float) -> Array:
    """What the ground must carry, in body weights, shape (n,)."""
    if len(poses) < 3:
        return np.ones(len(poses))
    height = momentum(Clip(poses, fps, "load")).com[:, 2]
    rising = np.gradient(np.gradient(height)) * fps**2
    return gaussian_filter1d(rising / _GRAVITY + 1.0, _SMOOTHING * fps)


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """Starts and ends of the stretches that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(int), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _cleaned(mask: Mask, gap: int, short: int) -> Mask:
    """With gaps filled and short stretches dropped, but for those at the ends."""
    mask = mask.copy()
    for start, end in _runs(~mask):
        if end - start < gap and start > 0 and end < len(mask):
            mask[start:end] = True
    for start, end in _runs(mask):
        if end - start < short:
            mask[start:end] = False
    return mask
