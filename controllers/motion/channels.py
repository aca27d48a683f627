"""Channels of a motion at successive times (a position, then quaternions wxyz, then others): signs and norms."""

import numpy as np

from geometry.arrays import Array


def signed_like(quaternions: Array, others: Array) -> Array:
    """The same rotations (..., 4), each with the sign that is nearer to the other one."""
    same = np.sum(quaternions * others, axis=-1, keepdims=True) >= 0.0
    return np.where(same, quaternions, -quaternions)


def normalise(channels: Array, count: int) -> None:
    """Give unit length to the `count` quaternions of channels (..., 3 + 4 count + …), in place."""
    last, shape = 3 + 4 * count, channels.shape[:-1]
    quaternions = channels[..., 3:last].reshape(*shape, count, 4)
    quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    channels[..., 3:last] = quaternions.reshape(*shape, 4 * count)


def closing_signs(channels: Array, count: int) -> Array:
    """−1 for channels (n, ..., 3 + 4 count + …) of a quaternion that returns as −q after a lap, 1 for all others."""
    signs = np.ones(channels.shape[1:])
    for first in range(3, 3 + 4 * count, 4):
        q = channels[..., first : first + 4]
        signs[..., first : first + 4] = np.where((q[-1] * q[0]).sum(axis=-1) < 0.0, -1.0, 1.0)[..., None]
    return signs
