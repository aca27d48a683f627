"""Where the zero-moment point of a motion lies."""

import numpy as np

from models.arrays import Array
from models.mocap.authoring.balance import Dynamics, supported


def outside_support(motion: Dynamics) -> Array:
    """How far the zero-moment point lies outside the support [m], shape (n,)."""
    nearest = [supported(point, contacts) for point, contacts in zip(motion.zmp, motion.contacts, strict=True)]
    return np.linalg.norm(motion.zmp - np.array(nearest), axis=1)
