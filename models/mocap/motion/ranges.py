"""Excess of poses over the ranges of the figure's joints."""

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.humanoid.skeleton import joint_range


def vectors_in_ranges(rotations: Array, low: Array, high: Array) -> Array:
    """Rotation vectors [rad], those that exceed the joints' ranges least, shape (n, 17, 3).

    A rotation has two vectors of less than a turn, v and (1 - 2π/|v|) v. The shorter one changes sides where the angle
    passes π, as in an elbow that is both bent and twisted; by it, a range of 155° would be exceeded by 143° there.

    Parameters
    ----------
    rotations : Array
        Joint rotations, shape (n, 17, 4).
    low, high : Array
        Ranges of the vectors' components, shape (17, 3) [rad].
    """
    shortest = quaternions.logarithm(rotations)
    angle = np.linalg.norm(shortest, axis=-1, keepdims=True)
    longer = (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9)) * shortest
    excess, other = (np.linalg.norm(v - np.clip(v, low, high), axis=-1, keepdims=True) for v in (shortest, longer))
    return np.where(other < excess, longer, shortest)


def beyond_ranges(poses: Array) -> Array:
    """Largest excess of each joint's rotation vector over its range [rad], (n, 75) → (n, 17); negative within it."""
    low, high = np.moveaxis(joint_range(), -1, 0)
    vectors = vectors_in_ranges(poses[:, 7:].reshape(len(poses), -1, 4), low, high)
    return np.maximum(low - vectors, vectors - high).max(axis=2)
