"""Position of the zero-moment point of a motion relative to its support."""

import numpy as np

from geometry.arrays import Array
from models.mocap.dynamics.zero_moment_point import nearest_supported
from tools.clip_authoring.balance import Dynamics


def distance_outside_support(motion: Dynamics) -> Array:
    """Distance of the zero-moment point from the support polygon [m], 0 inside, shape (n,)."""
    nearest = nearest_supported(motion.zmp, motion.contacts[..., :2], motion.touching, 1.0)
    return np.linalg.norm(motion.zmp - nearest, axis=1)
