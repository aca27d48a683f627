r"""Root path of a capture whose supporting foot slides: the body is shifted so that this foot rests.

Where the centre of mass accelerates as if under load but nothing on the floor is at rest (`stances.sliding_spheres`),
the captured path of the root is wrong by the motion of the supporting foot: a capture may give the rotations of limbs
and only an estimate of the root, or the feet slid on a floor with little friction. Static friction could not bear such
a load, and kinetic friction would brake the body by μ g. So the velocity of the root over the floor is changed by

.. math:: \Delta v(t) = -(G_\sigma * u)(t) ,

where u is the velocity of the slowest of the spheres that bear the load, zero elsewhere, and G_σ a Gaussian. Stances
are then detected again on the shifted motion. Inertial motion capture without positions finds the root's velocity from
the supporting foot in the same way (Yi et al. 2021, TransPose, ACM Trans. Graph. 40).

Where feet slide most of the time, as in a gait on a treadmill or a game's animation in place, the capture lacks the
body's travel, in flights as well. It is given back first, as uniform: the body moves against the median velocity of the
spheres that bear the load.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from geometry.arrays import Array, Mask
from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.poses import with_neighbours
from models.mocap.preparation.stances import sliding_spheres

# σ [s]: about a frame of 30 Hz captures; the optimisation of the dynamics smooths further. With half and twice the
# value a punch of DeepMimic has a residual of 4.5 and 4.6 % of body weight, with this value 5.6 % (14.3 % if it is not
# shifted).
_SMOOTHING = 0.04
# Share of the frames in which feet slide beyond which the capture lacks the body's travel: 0.67 or more in nine gaits
# in place, 0.36 at most in the 28 captures of docs/validation/prepared-captures.md.
_MIN_SLIDING_SHARE = 0.5


class _Slide(NamedTuple):
    """Spheres that bear load while they slide, (m, 8), velocities of all over the floor, (m, 8, 2), and first frame."""

    bearing: Mask
    velocities: Array
    first: int


def without_foot_sliding(clip: Clip, smooth: Clip) -> Clip:
    """The clip with its root shifted over the floor so that the supporting foot does not slide.

    Parameters
    ----------
    clip : Clip
        The clip as captured; a closed one is extended periodically, and its displacement per lap changes.
    smooth : Clip
        The same clip, low-passed.
    """
    slide = _slide(clip, smooth)
    if slide.bearing.any(axis=1).mean() > _MIN_SLIDING_SHARE:
        travel = -np.median(slide.velocities[slide.bearing], axis=0)
        clip, smooth = (
            shifted_over_floor(part, np.arange(part.n_frames)[:, None] * travel / part.fps) for part in (clip, smooth)
        )
        slide = _slide(clip, smooth)
    bearing, velocities, first = slide
    if not bearing.any():
        return clip
    speeds = np.where(bearing, np.linalg.norm(velocities, axis=2), np.inf)
    slowest = velocities[np.arange(len(bearing)), speeds.argmin(axis=1)]
    slowest[~np.any(bearing, axis=1)] = 0.0
    drift = gaussian_filter1d(slowest, _SMOOTHING * clip.fps, axis=0)[first : first + clip.n_frames - 1]
    return shifted_over_floor(clip, -np.concatenate((np.zeros((1, 2)), np.cumsum(drift, axis=0))) / clip.fps)


def _slide(clip: Clip, smooth: Clip) -> _Slide:
    poses, smooth_poses, first = with_neighbours(clip, smooth)
    bearing = sliding_spheres(poses, smooth_poses, clip.fps)
    return _Slide(bearing, np.gradient(sole_points(smooth_poses)[:, :, :2], axis=0) * clip.fps, first)


def shifted_over_floor(clip: Clip, shift: Array) -> Clip:
    """The clip with its root shifted by (n, 2) [m]."""
    poses = clip.poses.copy()
    poses[:, :2] += shift
    return Clip(poses, clip.fps, clip.name)
