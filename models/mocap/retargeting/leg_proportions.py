r"""Height of the hips over feet that stand, of a body whose thighs and shanks are not as long as the figure's.

Limbs point as the source's do, and the path of the hips is scaled by the length of the whole leg. With thighs that are
longer than the figure's by :math:`\delta`, and shanks that are shorter by as much, an ankle of the source is then lower
below the hips than the figure's by

.. math:: e = \delta\,(\cos\theta_{\text{thigh}} - \cos\theta_{\text{shank}})

with the angles of thigh and shank to the vertical: by nothing where the leg is straight, by :math:`-\delta` where the
body sits. The figure's feet would leave the floor when it sits down, and the floor would seem to slope from a chair to
the place where the body stands. So the hips are moved by :math:`e` of the foot that stands, and from one stance to the
next linearly in time, so that flights remain parabolas.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from models.arrays import Array
from models.humanoid.skeleton import BODIES, figure_model
from models.mocap.motion import quaternions
from models.mocap.retargeting.body_lines import SIDES

# Half or twice of the first and the last moves hips of ten captures by 2 mm at most; of the second by 5 and 16 mm.
_STILL = 0.4  # largest speed of an ankle that stands, as of soles in `footing` [m/s]
_LOWER = 0.03  # height over the lower foot at which the other one counts for 1/e [m]
_SMOOTHING = 0.05  # standard deviation of the Gaussian filter over what hips are moved [s]
# By how much less level the figure's stances must be than the source's [m]: of 144 captures they are so in 131 by 0.010
# at most, in 13 by 0.038 and more.
_LEAST = 0.02
_LEG = (("thigh", "shank"), ("shank", "foot"))  # segments of a leg, each with the body at its end


def hips_over_feet(root: Array, segments: Array, legs: Array, ankles: Array, fps: float) -> Array:
    """The path of the hips on which feet stand as level as the source's; the same one if they do so anyway.

    Parameters
    ----------
    root : array of shape (frames, 3)
        Positions of the pelvis [m], z up.
    segments : array of shape (frames, 18, 4)
        Rotations of the segments in the world.
    legs, ankles : arrays of shape (frames, 2, 3)
        The source's ankles from their hips and from the pelvis, scaled to the figure's legs, in the world's axes [m];
        NaN where it has none.
    fps : float
        Frame rate [1/s].
    """
    if len(root) < 2 or np.isnan(ankles).any():
        return root
    places = root[:, None] + ankles
    heights = places[..., 2]
    lower = np.arange(len(root)), heights.argmin(axis=1)
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=2)[lower] * fps
    stands = np.flatnonzero(speed < _STILL)
    if len(stands) == 0:
        return root
    weights = np.exp((heights[lower][:, None] - heights) / _LOWER)
    excess = (weights * (legs - _own_legs(segments))[..., 2]).sum(axis=1) / weights.sum(axis=1)
    level = heights[lower]
    if _spread((level - excess)[stands]) < _spread(level[stands]) + _LEAST:
        return root
    moved = np.interp(np.arange(len(root)), stands, excess[stands])
    moved = gaussian_filter1d(moved, _SMOOTHING * fps, mode="nearest")
    return root + np.outer(moved - moved[0], [0.0, 0.0, 1.0])


def _spread(heights: Array) -> float:
    """Range of heights [m] but for a twentieth at either end."""
    return float(np.ptp(np.quantile(heights, (0.05, 0.95))))


def _own_legs(segments: Array) -> Array:
    """The figure's ankles from its hips, in the world's axes [m], shape (frames, 2, 3)."""
    model = figure_model()
    legs = np.zeros((len(segments), len(SIDES), 3))
    for column, side in enumerate(SIDES):
        for part, end in _LEG:
            thigh_or_shank = segments[:, BODIES.index(f"{side}_{part}")]
            legs[:, column] += quaternions.rotated(thigh_or_shank, model.body(f"{side}_{end}").pos)
    return legs
