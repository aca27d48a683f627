"""Excess of poses over the ranges of the figure's joints."""

import numpy as np

from models.arrays import Array
from models.humanoid.skeleton import joint_range
from models.mocap.motion import quaternions


def beyond_ranges(poses: Array) -> Array:
    """Largest excess of each joint's rotation vector over its range [rad], (n, 75) → (n, 17); negative within it."""
    vectors, ranges = quaternions.logarithm(poses[:, 7:].reshape(len(poses), -1, 4)), joint_range()
    return np.maximum(ranges[:, :, 0] - vectors, vectors - ranges[:, :, 1]).max(axis=2)
