r"""Height of the hips above standing feet, for a body whose leg proportions (thigh to shank) differ from the figure's.

Limbs point as the source's do, and the path of the hips is scaled by the length of the whole leg. If the source's
thighs are longer than the figure's by :math:`\delta`, and its shanks shorter by as much, its ankle is lower below the
hips than the figure's by

.. math:: e = \delta\,(\cos\theta_{\text{thigh}} - \cos\theta_{\text{shank}})

with the angles of thigh and shank to the vertical: zero for a straight leg, :math:`-\delta` for a sitting body. The
figure's feet would leave the floor when it sits down, and the floor would seem to slope from a chair to the place where
the body stands. So the hips are moved by :math:`e` of the standing foot, and from one stance to the next linearly in
time, so that flights remain parabolas.

Hips that are wider than the figure's, in proportion to the legs, raise one foot further where they tilt. The figure's
feet are then at different heights where both stand in the source; this is measured, not corrected.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from geometry.arrays import Array
from models.humanoid.skeleton import BODIES
from models.mocap.motion.kinematics import segment_positions
from models.mocap.retargeting.body_lines import SIDES
from models.mocap.retargeting.footing import MAX_STANDING_SPEED

# Half or twice this height moves the hips of ten captures by 5 and 16 mm; `MAX_STANDING_SPEED` and the next value by at
# most 2 mm.
_WEIGHT_DECAY_HEIGHT = 0.03  # height above the lower foot at which the other one has the weight 1/e [m]
_SMOOTHING = 0.05  # standard deviation of the Gaussian filter for the correction of the hips [s]
# Least improvement: by how much less level the figure's stances must be than the source's [m]. Of 144 captures it is at
# most 0.010 in 131, and 0.038 and more in 13.
_MIN_IMPROVEMENT = 0.02
_MAX_ANKLE_DIFFERENCE = 0.03  # largest difference in height of the ankles of two feet that stand flat [m]
_RISE_QUANTILE = 0.95  # of the frames in which both stand
_THIGHS, _FEET = ([BODIES.index(f"{side}_{part}") for side in SIDES] for part in ("thigh", "foot"))


def hips_over_feet(root: Array, segments: Array, legs: Array, ankles: Array, fps: float) -> Array:
    """The path of the hips on which feet stand as level as the source's; unchanged if they already do.

    Parameters
    ----------
    root : array of shape (frames, 3)
        Positions of the pelvis [m], z up.
    segments : array of shape (frames, 18, 4)
        Rotations of the segments in the world.
    legs, ankles : arrays of shape (frames, 2, 3)
        The source's ankles relative to their hips and to the pelvis, scaled to the figure's legs, in the world's axes
        [m]; NaN if it has none.
    fps : float
        Frame rate [1/s].
    """
    if len(root) < 2 or np.isnan(ankles).any():
        return root
    places = root[:, None] + ankles
    heights = places[..., 2]
    lower = np.arange(len(root)), heights.argmin(axis=1)
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=2)[lower] * fps
    stance_frames = np.flatnonzero(speed < MAX_STANDING_SPEED)
    if len(stance_frames) == 0:
        return root
    weights = np.exp((heights[lower][:, None] - heights) / _WEIGHT_DECAY_HEIGHT)
    joints = segment_positions(root, segments)
    excess = (weights * (legs - (joints[:, _FEET] - joints[:, _THIGHS]))[..., 2]).sum(axis=1) / weights.sum(axis=1)
    level = heights[lower]
    if _height_range((level - excess)[stance_frames]) < _height_range(level[stance_frames]) + _MIN_IMPROVEMENT:
        return root
    shift = np.interp(np.arange(len(root)), stance_frames, excess[stance_frames])
    shift = gaussian_filter1d(shift, _SMOOTHING * fps, mode="nearest")
    return root + np.outer(shift - shift[0], [0.0, 0.0, 1.0])


def rise_of_a_standing_foot(root: Array, segments: Array, ankles: Array, fps: float) -> float:
    """Height of the figure's higher foot above the other, where both stand flat in the source [m]; 0 if they never do.

    Parameters
    ----------
    root, segments, ankles, fps
        As for `hips_over_feet`.
    """
    places = root[:, None] + ankles
    speeds = np.zeros(places.shape[:2])
    if len(root) > 1:
        speeds = np.linalg.norm(np.gradient(places, axis=0), axis=2) * fps
    source = places[:, 0, 2] - places[:, 1, 2]
    both = (speeds.max(axis=1) < MAX_STANDING_SPEED) & (np.abs(source) < _MAX_ANKLE_DIFFERENCE)
    if not both.any():
        return 0.0
    left, right = segment_positions(root, segments)[both][:, _FEET, 2].T
    return float(np.quantile(np.abs(left - right - source[both]), _RISE_QUANTILE))


def _height_range(heights: Array) -> float:
    """Range of heights [m] without a twentieth at either end."""
    return float(np.ptp(np.quantile(heights, (0.05, 0.95))))
