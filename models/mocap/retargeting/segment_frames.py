"""Rotations of segments: from two directions, and by a constant offset from a joint."""

import numpy as np
from scipy.spatial.transform import Rotation

from geometry import quaternions
from geometry.arrays import Array
from geometry.quaternions import unit


def frames(left: Array, along: Array) -> Array:
    """Rotations that turn y into `left` and z as nearly as possible into `along`, shape (n, 4)."""
    x = unit(np.cross(left, along))
    matrices = np.stack((x, left, np.cross(x, left)), axis=-1)
    # If both are parallel, the frame is undefined; the substitute has no weight, since such a trunk is not straight.
    matrices[np.isnan(matrices).any(axis=(1, 2))] = np.eye(3)
    return np.asarray(Rotation.from_matrix(matrices).as_quat(scalar_first=True))


def with_constant_offset(source: Array, wanted: Array, weights: Array) -> Array:
    """G C with C the mean of G⁻¹ T (Markley et al. 2007: the mean that minimises the chordal distance)."""
    offsets = Rotation.from_quat(quaternions.product(quaternions.conjugate(source), wanted), scalar_first=True)
    constant = np.asarray(offsets.mean(weights).as_quat(scalar_first=True))
    return quaternions.product(source, constant)
