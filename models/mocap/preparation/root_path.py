r"""Root path of a capture whose supporting foot slides: the body is shifted so that this foot rests.

Where the centre of mass accelerates as if under load but nothing on the floor is at rest (`stances.sliding_spheres`),
the captured path of the root is wrong by the motion of the supporting foot: a capture may give the rotations of limbs
and only an estimate of the root, or the feet slid on a floor with little friction. Static friction could not bear such
a load, and kinetic friction would brake the body by μ g. So the velocity of the root over the floor is changed by

.. math:: \Delta v(t) = -(G_\sigma * u)(t) ,

where u is the velocity of the slowest of the spheres that bear the load, zero elsewhere, and G_σ a Gaussian. Stances
are then detected again on the shifted motion. Inertial motion capture without positions finds the root's velocity from
the supporting foot in the same way (Yi et al. 2021, TransPose, ACM Trans. Graph. 40).
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from models.mocap.motion.clip import Clip
from models.mocap.motion.kinematics import sole_points
from models.mocap.preparation.poses import with_neighbours
from models.mocap.preparation.stances import sliding_spheres

# σ [s]: about a frame of 30 Hz captures; the optimisation of the dynamics smooths further. With half and twice the
# value a punch of DeepMimic has a residual of 4.5 and 4.6 % of body weight, with this value 5.6 % (14.3 % if it is not
# shifted).
_SMOOTHING = 0.04


def without_foot_sliding(clip: Clip, smooth: Clip) -> Clip:
    """The clip with its root shifted over the floor so that the supporting foot does not slide.

    Parameters
    ----------
    clip : Clip
        The clip as captured; a closed one is extended periodically, and its displacement per lap changes.
    smooth : Clip
        The same clip, low-passed.
    """
    n = clip.n_frames
    poses, smooth_poses, first = with_neighbours(clip, smooth)
    bearing = sliding_spheres(poses, smooth_poses, clip.fps)
    if not bearing.any():
        return clip
    velocities = np.gradient(sole_points(smooth_poses)[:, :, :2], axis=0) * clip.fps
    speeds = np.where(bearing, np.linalg.norm(velocities, axis=2), np.inf)
    slowest = velocities[np.arange(len(poses)), speeds.argmin(axis=1)]
    slowest[~np.any(bearing, axis=1)] = 0.0
    drift = gaussian_filter1d(slowest, _SMOOTHING * clip.fps, axis=0)
    shifted = poses[first : first + n].copy()
    shifted[1:, :2] -= np.cumsum(drift[first : first + n - 1], axis=0) / clip.fps
    return Clip(shifted, clip.fps, clip.name)
