r"""Which parts of the soles stand when and where: the contact schedule of a capture, from its soles and its load.

Heel and toes of a foot stand while they are near the floor and slow; one flat place is taken for a whole stance. Where
nothing stands but the centre of mass accelerates as if something did, the lowest part of the feet must bear: captures
slide and hover.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from models.humanoid.skeleton import BODIES, CONTACT_RADIUS
from models.mocap.clip import Clip, global_rotations
from models.mocap.dynamics.floor_forces import soles
from models.mocap.dynamics.momentum import momentum
from models.mocap.preparation.poses import around, sole_points

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

# Chosen on eight captures (../shared/prepare-prototype.md): ±1 cm and ±0.1 m/s move the residual by less than 1 point.
_REACH = 0.045  # a part of a sole that stands is lower than this [m] ...
_SLOW = 0.55  # ... and slower [m/s]
_GAP, _SHORT = 0.05, 0.06  # gaps shorter than this are filled, stances shorter than this dropped [s]
_LAG = 0.012  # a sphere stands this long before and after it pushes [s]
_LOADED = 0.35  # of body weight, above which something must bear
_NEAR = 0.015  # over the lowest sphere [m]: they bear together
_SMOOTHING = 0.02  # of the load [s]
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
    points = sole_points(poses)
    standing = np.zeros(points.shape[:2], dtype=bool)
    places = np.full(points.shape, CONTACT_RADIUS)
    turned = global_rotations(poses)
    for foot, side in enumerate(("left", "right")):
        mine = slice(4 * foot, 4 * foot + 4)
        _plant(points[:, mine], turned[:, BODIES.index(f"{side}_foot")], soles()[mine], clip.fps,
               standing[:, mine], places[:, mine])  # fmt: skip
    load = _load(calm, clip.fps)
    bare = ~standing.any(axis=1) & (load > _LOADED)
    bare = _cleaned(bare, round(0.03 * clip.fps), 2)
    heights = points[:, :, 2] - CONTACT_RADIUS
    sliding = bare[:, None] & (heights < heights.min(axis=1, keepdims=True) + _NEAR)
    lag = max(1, round(_LAG * clip.fps))
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


def _plant(points: Array, turned: Array, sole: Array, fps: float, standing: Mask, places: Array) -> None:
    """Write one foot's stances: parts that stand, and one flat place for each stance."""
    parts: list[Mask] = []
    for pair in (points[:, :2], points[:, 2:]):
        middle = pair.mean(axis=1)
        speed = np.linalg.norm(np.gradient(middle, axis=0), axis=1) * fps
        stands = (middle[:, 2] - CONTACT_RADIUS < _REACH) & (speed < _SLOW)
        parts.append(_cleaned(stands, round(_GAP * fps), round(_SHORT * fps)))
    heel, toe = parts
    # Heading of the foot's own forward axis.
    x = 1.0 - 2.0 * (turned[:, 2] ** 2 + turned[:, 3] ** 2)
    y = 2.0 * (turned[:, 1] * turned[:, 2] + turned[:, 0] * turned[:, 3])
    yaw = np.unwrap(np.arctan2(y, x))
    for start, end in _runs(heel | toe):
        span = np.arange(start, end)
        flat = span[heel[span] & toe[span]]
        if len(flat) >= 4:
            frames, spheres = flat, [0, 1, 2, 3]
        elif toe[span].sum() >= heel[span].sum():
            frames, spheres = span[toe[span]], [2, 3]
        else:
            frames, spheres = span[heel[span]], [0, 1]
        angle = float(np.median(yaw[frames]))
        c, s = np.cos(angle), np.sin(angle)
        lying = sole[:, :2] @ np.array([[c, s], [-s, c]])
        origin = np.median(points[frames][:, spheres, :2] - lying[spheres], axis=(0, 1))
        places[start:end, :, :2] = lying + origin
        standing[start:end, :2] = heel[start:end, None]
        standing[start:end, 2:] = toe[start:end, None]


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
