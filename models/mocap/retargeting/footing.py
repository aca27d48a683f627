"""Where the floor is under a retargeted motion, how it slopes, and toes that do not go through it.

A volume calibrated askew gives a floor that slopes. Where the body stands at places far enough from each other,
a plane through its level soles tells; it is believed where it is significant, and its rotation levels the motion.

The figure's foot is one rigid piece. A foot that rolls off over bent toes would push the figure's through the floor, so
where the toes' contact points are too low the ankle bends them up, about its own lateral axis, until they touch.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from models.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, SEGMENTS, figure_model
from models.mocap import quaternions

_LEVEL = 0.06  # the four contact points of a sole that is level differ by less in height [m]
_SHARE = 0.25  # of the supporting, level soles are at or below the floor
_STILL = 0.4  # m/s, of a sole that stands
_SPREAD = 0.25  # RMS distance of standing soles along a direction, from which its slope is told [m]: a stride has 0.4
_STEPS, _SURE = 4, 3.0  # stances at least, and standard errors that a slope is from level
_SLOPE = np.deg2rad((0.5, 8.0))  # what is no slope, and what is none of a floor that was meant to be level
_UNEVEN = 0.025  # RMS of the soles about the plane, beyond which they stand on stairs or boxes [m]
_SMOOTHING = 0.02  # standard deviation of the window that smooths the bend of the toes [s]
_FEET = tuple(BODIES.index(f"{side}_foot") for side in ("left", "right"))
_PLACES = ("heel_out", "heel_in", "toe_out", "toe_in")


def on_the_floor(root: Array, segments: Array, fps: float) -> tuple[Array, Array]:
    """The motion shifted vertically, by one constant, onto the floor, with toes bent up where they would go through it.

    Parameters
    ----------
    root : array of shape (frames, 3)
        Positions of the pelvis [m], z up.
    segments : array of shape (frames, 18, 4)
        Rotations of the segments in the world.
    fps : float
        Frames per second [1/s].

    Returns
    -------
    root, segments : arrays
        The same after the shift and the bending of the ankles.
    """
    ankles = root[:, None, 2] + _ankles(segments)[..., 2]
    feet = segments[:, _FEET]
    points = _contact_points()
    heights = ankles[:, :, None] + quaternions.rotated(feet[:, :, None], points)[..., 2] - CONTACT_RADIUS
    floor = _floor(heights)
    bend = _toe_bend(ankles - floor - CONTACT_RADIUS, feet, points)
    # A foot that points straight down leaves the floor at once, and its bend with it: faster than any ankle.
    bend = gaussian_filter1d(bend, _SMOOTHING * fps, axis=0, mode="nearest")
    segments = segments.copy()
    segments[:, _FEET] = quaternions.product(feet, quaternions.about_axis(1, bend))
    return root - np.array([0.0, 0.0, floor]), segments


def _contact_points() -> Array:
    """Centres of the contact spheres in the frames of the feet, shape (2, 4, 3)."""
    model = figure_model()
    return np.array([[model.geom(f"{side}_{place}").pos for place in _PLACES] for side in ("left", "right")])


def _ankles(segments: Array) -> Array:
    """The ankles from the pelvis [m], shape (frames, 2, 3)."""
    model = figure_model()
    places = np.zeros((len(segments), len(_FEET), 3))
    for column, body in enumerate(_FEET):
        while (parent := SEGMENTS[body].parent) >= 0:
            places[:, column] += quaternions.rotated(segments[:, parent], model.body(BODIES[body]).pos)
            body = parent
    return places


def levelled(root: Array, segments: Array, fps: float) -> tuple[Array, Array, float]:
    """The motion turned so that the floor on which it stands is level, and by what angle [rad]; 0 where none is told.

    Parameters
    ----------
    root, segments, fps
        As in `on_the_floor`.
    """
    soles = (root[:, None] + _ankles(segments))[:, :, None] + quaternions.rotated(
        segments[:, _FEET][:, :, None], _contact_points()
    )
    middle = soles.mean(axis=2)
    lower = np.arange(len(soles)), np.argmin(middle[..., 2], axis=1)
    if len(soles) < 4:
        return root, segments, 0.0
    speed = np.linalg.norm(np.gradient(middle, axis=0), axis=2)[lower] * fps
    stands = (np.ptp(soles[lower][..., 2], axis=1) < _LEVEL) & (speed < _STILL)
    stances = int(np.sum(np.diff(np.concatenate(([0], np.where(stands, lower[1] + 1, 0)))) > 0))
    slopes = _slopes(middle[lower][stands], stances) if stances >= _STEPS else np.zeros(2)
    angle = float(np.arctan(np.linalg.norm(slopes)))
    if not _SLOPE[0] < angle < _SLOPE[1]:
        return root, segments, 0.0
    # The plane z = s·(x, y) has the normal (−s, 1); turned about normal × z it is level.
    axis = np.array([-slopes[1], slopes[0], 0.0]) / np.linalg.norm(slopes)
    level = np.concatenate(([np.cos(angle / 2)], np.sin(angle / 2) * axis))
    return quaternions.rotated(level, root), quaternions.product(level, segments), angle


def _slopes(points: Array, stances: int) -> Array:
    """dz/dx, dz/dy of the plane through points of so many stances, in the directions in which they tell it."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    height = points[:, 2] - points[:, 2].mean()
    _, sizes, directions = np.linalg.svd(flat, full_matrices=False)
    spread = sizes / np.sqrt(len(points))
    told = np.where(spread > _SPREAD, 1.0, 0.0)
    slopes = told * (directions @ flat.T @ height) / np.maximum(sizes, 1e-9) ** 2
    off = float(np.sqrt(np.mean((height - flat @ directions.T @ slopes) ** 2)))
    sure = np.abs(slopes) > _SURE * off / (np.maximum(spread, 1e-9) * np.sqrt(stances))
    return np.zeros(2) if off > _UNEVEN else directions.T @ (slopes * sure)


def _floor(heights: Array) -> float:
    """Height of the floor from the contact points', shape (frames, 2, 4): where the lower foot's level sole is."""
    lower = np.argmin(heights.min(axis=2), axis=1)
    sole = heights[np.arange(len(heights)), lower]
    level = np.ptp(sole, axis=1) < _LEVEL
    # Where no foot is ever put down flat, the lowest points are taken instead.
    return float(np.quantile(sole[level].mean(axis=1) if level.any() else sole.min(axis=1), _SHARE))


def _toe_bend(ankles: Array, feet: Array, points: Array) -> Array:
    """Rotations about the feet's y axis [rad], ≤ 0, after which no toe is below the floor, shape (frames, 2).

    A point p of a foot whose frame has the vertical r is, after a bend by δ, at the height
    h + r_y p_y + (r_x p_x + r_z p_z) cos δ + (r_x p_z − r_z p_x) sin δ.
    """
    r = quaternions.rotated(quaternions.conjugate(feet), np.array([0.0, 0.0, 1.0]))[:, :, None]
    p = points[:, 2:]
    constant = ankles[:, :, None] + r[..., 1] * p[..., 1]
    cosine = r[..., 0] * p[..., 0] + r[..., 2] * p[..., 2]
    sine = r[..., 0] * p[..., 2] - r[..., 2] * p[..., 0]
    turn = np.arctan2(sine, cosine) + np.arccos(np.clip(-constant / np.hypot(cosine, sine), -1.0, 1.0))
    turn = np.where(turn > np.pi, turn - 2.0 * np.pi, turn)
    # A foot that points straight down, or a little further, still bends forwards: its toes got there from ahead.
    needed = (constant + cosine < 0.0) & (sine < 0.05)
    return np.where(needed, np.clip(turn, -np.pi / 3, 0.0), 0.0).min(axis=2)
