"""Where the zero-moment point of a motion lies."""

import numpy as np

from models.arrays import Array
from models.mocap.authoring.balance import Dynamics
from models.mocap.dynamics.zero_moment_point import nearest_supported


def outside_support(motion: Dynamics) -> Array:
    """How far the zero-moment point lies outside the support [m], shape (n,)."""
    nearest = nearest_supported(motion.zmp, motion.contacts[..., :2], motion.touching, 1.0)
    return np.linalg.norm(motion.zmp - nearest, axis=1)
