"""Floor of a retargeted motion: its height and slope, and ankle rotations that keep toes above it.

A badly calibrated capture volume has a sloping floor. If the body stands at places far enough from each other, the
slope is estimated by a plane through its level soles; if it is significant, the motion is rotated so that it is level.

The figure's foot is one rigid body. At push-off over bent toes it would penetrate the floor, so where contact points of
the toes are too low, the ankle is rotated about its lateral axis until they touch.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import stdtrit

from geometry import quaternions
from geometry.arrays import Array, IntArray, Mask, rms
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, soles
from models.mocap.motion.kinematics import segment_positions

# Largest height difference among the contact points of a level sole [m]: half or twice moves the floor by 1 or 2 mm.
_MAX_SOLE_RANGE = 0.06
# Quantile of the heights of level soles that is taken as the floor: half the value moves the floor of 19 captures by
# 2 mm, twice by 4 mm (10 mm in one of them).
_FLOOR_QUANTILE = 0.25
# Largest speed of a standing sole [m/s]: with half the value one of the 28 captures of
# docs/validation/prepared-captures.md gets a slope of 1.4°, with twice one keeps its slope.
MAX_STANDING_SPEED = 0.4
_MIN_SPREAD = 0.25  # least RMS spread of standing soles in a direction whose slope is estimated [m]: a stride has 0.4
# Least number of stances: half the value changes none of 17 captures, twice leaves the slope of one of them.
_MIN_STANCE_COUNT = 4
# Significance level (two-sided) against a level floor: half or twice changes none of the 28 captures.
_SIGNIFICANCE = 0.02
# Smaller slopes are ignored, larger ones are not due to calibration. With 1° two of 17 captures keep their slopes;
# 0.25, 4 or 16° change none.
_SLOPE_RANGE = np.deg2rad((0.5, 8.0))
# RMS deviation of the soles from the plane above which they are taken to stand on stairs or boxes [m]: half or twice
# changes none of 17 captures.
_MAX_UNEVENNESS = 0.025
# Least fraction of the slope that the stances of each foot alone must show: negative in a dance; 0.25 or 0.7 change
# none of the 28 captures.
_MIN_AGREEMENT = 0.5
# Standard deviation of the Gaussian filter for the ankles' correction [s]: without it toe-off turns ankles faster
# than any human's. Half or twice turns the joints of 19 captures by 0.1 or 0.2° RMS.
_SMOOTHING = 0.02
_ALL = slice(None)
_FEET = tuple(BODIES.index(f"{side}_foot") for side in ("left", "right"))


def put_on_floor(root: Array, segments: Array, fps: float, counted: Mask | slice = _ALL) -> tuple[Array, Array]:
    """The motion shifted vertically by a constant onto the floor, with feet pitched up where toes would penetrate it.

    Parameters
    ----------
    root : array of shape (frames, 3)
        Positions of the pelvis [m], z up.
    segments : array of shape (frames, 18, 4)
        Rotations of the segments in the world.
    fps : float
        Frame rate [1/s].
    counted : array of bool, shape (frames,)
        Frames from which the floor is estimated.

    Returns
    -------
    root, segments : arrays
        Positions and rotations after the shift and the rotation of the ankles.
    """
    ankles = segment_positions(root, segments)[:, _FEET, 2]
    feet = segments[:, _FEET]
    points = soles().reshape(2, 4, 3)
    heights = ankles[:, :, None] + quaternions.rotated(feet[:, :, None], points)[..., 2] - CONTACT_RADIUS
    floor = _floor_height(heights[counted])
    bend = _toe_correction(ankles - floor - CONTACT_RADIUS, feet, points)
    # The correction of a foot that points straight down ends abruptly when the foot leaves the floor, so it is
    # smoothed.
    bend = gaussian_filter1d(bend, _SMOOTHING * fps, axis=0, mode="nearest")
    segments = segments.copy()
    segments[:, _FEET] = quaternions.product(feet, quaternions.about_axis(1, bend))
    return root - np.array([0.0, 0.0, floor]), segments


def levelled(root: Array, segments: Array, fps: float) -> tuple[Array, Array, float]:
    """The motion rotated so that its floor is level, and the angle [rad]; 0 where no slope can be estimated.

    Parameters
    ----------
    root, segments, fps
        As in `put_on_floor`.
    """
    feet = quaternions.rotated(segments[:, _FEET][:, :, None], soles().reshape(2, 4, 3))
    points = segment_positions(root, segments)[:, _FEET, None] + feet
    middle = points.mean(axis=2)
    lower = np.arange(len(points)), np.argmin(middle[..., 2], axis=1)
    if len(points) < 4:
        return root, segments, 0.0
    speed = np.linalg.norm(np.gradient(middle, axis=0), axis=2)[lower] * fps
    # Not `contacts.standing_parts`: the floor, above which a sole could be low, is not known yet.
    stance = (np.ptp(points[lower][..., 2], axis=1) < _MAX_SOLE_RANGE) & (speed < MAX_STANDING_SPEED)
    begins = stance & (np.diff(np.where(stance, lower[1], -1), prepend=-1) != 0)  # also if the other foot takes over
    stances = int(begins.sum())
    slopes = (
        _floor_slopes(middle[lower][stance], lower[1][stance], stances) if stances >= _MIN_STANCE_COUNT else np.zeros(2)
    )
    angle = float(np.arctan(np.linalg.norm(slopes)))
    if not _SLOPE_RANGE[0] < angle < _SLOPE_RANGE[1]:
        return root, segments, 0.0
    # The plane z = s·(x, y) has the normal (−s, 1); turned about normal × z it is level.
    axis = np.array([-slopes[1], slopes[0], 0.0]) / np.linalg.norm(slopes)
    leveling = np.concatenate(([np.cos(angle / 2)], np.sin(angle / 2) * axis))
    return quaternions.rotated(leveling, root), quaternions.product(leveling, segments), angle


def _floor_slopes(points: Array, feet: IntArray, stances: int) -> Array:
    """Slopes dz/dx, dz/dy of parallel planes through points of standing soles; 0 in directions without significance.

    One plane for each foot (0, 1): their soles need not lie at the same height in the file.
    """
    centred, both = np.zeros_like(points), np.unique(feet)
    for foot in both:
        centred[feet == foot] = points[feet == foot] - points[feet == foot].mean(axis=0)
    flat, height = centred[:, :2], centred[:, 2]
    _, sizes, directions = np.linalg.svd(flat, full_matrices=False)
    spread = sizes / np.sqrt(len(points))
    is_spread = np.where(spread > _MIN_SPREAD, 1.0, 0.0)
    slopes = is_spread * (directions @ flat.T @ height) / np.maximum(sizes, 1e-9) ** 2
    deviation = rms(height - flat @ directions.T @ slopes)
    # A plane fits a few stances well whatever its slope: Student's t with the remaining degrees of freedom.
    degrees = stances - len(both) - int(is_spread.sum())
    min_rise = (
        float(stdtrit(degrees, 1.0 - _SIGNIFICANCE / 2.0)) * deviation / np.sqrt(degrees) if degrees > 0 else np.inf
    )
    significant = np.abs(slopes) * spread > min_rise
    slope = directions.T @ (slopes * significant)
    rises = flat @ slope
    agree = all(
        rises[feet == foot] @ height[feet == foot] >= _MIN_AGREEMENT * np.sum(rises[feet == foot] ** 2) for foot in both
    )
    return slope if deviation <= _MAX_UNEVENNESS and agree else np.zeros(2)


def _floor_height(heights: Array) -> float:
    """Height of the floor [m] from heights of contact points (frames, 2, 4): that of the lower foot's level soles."""
    lower = np.argmin(heights.min(axis=2), axis=1)
    sole = heights[np.arange(len(heights)), lower]
    level = np.ptp(sole, axis=1) < _MAX_SOLE_RANGE
    # If no foot is ever put down flat, the lowest contact points are used.
    return float(np.quantile(sole[level].mean(axis=1) if level.any() else sole.min(axis=1), _FLOOR_QUANTILE))


def _toe_correction(ankles: Array, feet: Array, points: Array) -> Array:
    """Rotations about the feet's y axis [rad], ≤ 0, after which no toe is below the floor, shape (frames, 2).

    After a rotation by δ, a point p of a foot, with the vertical r in the foot's frame and the ankle's height h, is at
    h + r_y p_y + (r_x p_x + r_z p_z) cos δ + (r_x p_z − r_z p_x) sin δ.
    """
    r = quaternions.rotated(quaternions.conjugate(feet), np.array([0.0, 0.0, 1.0]))[:, :, None]
    p = points[:, 2:]
    constant = ankles[:, :, None] + r[..., 1] * p[..., 1]
    cosine = r[..., 0] * p[..., 0] + r[..., 2] * p[..., 2]
    sine = r[..., 0] * p[..., 2] - r[..., 2] * p[..., 0]
    turn = np.arctan2(sine, cosine) + np.arccos(np.clip(-constant / np.hypot(cosine, sine), -1.0, 1.0))
    turn = np.where(turn > np.pi, turn - 2.0 * np.pi, turn)
    # The tolerance on `sine` includes feet that point straight down or a little further back.
    needed = (constant + cosine < 0.0) & (sine < 0.05)
    return np.where(needed, np.clip(turn, -np.pi / 3, 0.0), 0.0).min(axis=2)
