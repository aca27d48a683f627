"""Offline inverse kinematics of a led clip: height of the root at which limbs reach their ends, and joint rotations.

At run time the map corrects limbs with a soft saturation (`limbs`). Where the path is straight, that correction leaves
rows unchanged whose joints already reach the ends exactly; so the exact solution is computed here beforehand.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.motion.channels import signed_like
from geometry.arrays import Array

# Largest extension of a limb over its length. A led knee that gets straighter stops with 2500 rad/s², beyond its motor.
# Knees of eight led captures accelerate by up to 1040 rad/s²; with 0.98 by 810, with the root 0.8 cm lower; with 0.998
# by 1470.
_MAX_EXTENSION = 0.99
_MIN_FLEXION = 0.03  # [rad] least flexion of the middle joint


def extension(rows: Array, stride: float, limb: Limb, at: int) -> float:
    """Largest distance between a limb's first and last joint over the lap [m]; parameters as in `shortfall`."""
    return float(np.linalg.norm(_limb_vector(rows, stride, limb, at), axis=1).max())


def shortfall(rows: Array, stride: float, limb: Limb, at: int, longest: float = 0.0) -> Array:
    """Lowering of the root that a limb needs to reach its end [m], shape (n,).

    Parameters
    ----------
    rows : Array, shape (n, nq + 4 limbs)
        Channels (`led`).
    stride : float
        Length of a lap [m], along x.
    limb : Limb
    at : int
        First column of the limb's end.
    longest : float
        Largest allowed extension [m], if more than `_MAX_EXTENSION` times the limb's length.
    """
    longest = max(_MAX_EXTENSION * float(np.linalg.norm(limb.offsets[1]) + np.linalg.norm(limb.offsets[2])), longest)
    line = _limb_vector(rows, stride, limb, at)
    horizontal = np.linalg.norm(line[:, :2], axis=1)
    return np.maximum(0.0, -line[:, 2] - np.sqrt(np.maximum(longest**2 - horizontal**2, 0.0)))


def solve_reach(rows: Array, stride: float, limbs: Sequence[Limb]) -> Array:
    """Channels (n, nq + 4 limbs) with the first two joints of each limb solved so that its last joint meets its end.

    The middle joint turns about its flexion axis, to the side to which it is bent on average; the first joint turns
    the shortest way.
    """
    result, first = rows.copy(), rows.shape[1] - N_END_CHANNELS * len(limbs)
    for j, limb in enumerate(limbs):
        columns = [slice(3 + 4 * joint, 7 + 4 * joint) for joint in limb.joints[:2]]
        upper, middle = (Rotation.from_quat(rows[:, column], scalar_first=True) for column in columns)
        root = Rotation.from_quat(rows[:, 3:7], scalar_first=True)
        line = root.inv().apply(_limb_vector(rows, stride, limb, first + N_END_CHANNELS * j))
        a, b = limb.offsets[1:]
        axis = np.asarray(limb.axis) / np.linalg.norm(limb.axis)
        # |line|² = |a|² + |b|² + 2 (a·b_axis + B cos δ + C sin δ), with b turned by δ about the axis.
        m = middle.inv().apply(a)
        along = (m @ axis) * (b @ axis)
        cosine, sine = m @ b - along, m @ np.cross(axis, b)
        size, straight = np.hypot(cosine, sine), np.arctan2(sine, cosine)
        wanted = (0.5 * ((line**2).sum(axis=1) - a @ a - b @ b) - along) / size
        bend = np.arccos(np.clip(wanted, -1.0, np.cos(_MIN_FLEXION)))
        # The side of flexion is that of the mean, so that a knee that is hyperextended in some frames bends normally.
        turn = straight - np.sign(straight.mean()) * bend
        middle = middle * Rotation.from_rotvec(turn[:, None] * axis)
        reach = upper.apply(a + middle.apply(b))
        upper = _shortest_rotations(reach, line) * upper
        for column, turned in zip(columns, (upper, middle), strict=True):
            result[:, column] = signed_like(turned.as_quat(scalar_first=True), rows[:, column])
    return result


def _limb_vector(channels: Array, stride: float, limb: Limb, at: int) -> Array:
    """Vector from a limb's first joint to its last, in the axes of the path [m], shape (n, 3)."""
    place = 3 + 4 * limb.joints[2]
    end = Rotation.from_quat(channels[:, place : place + 4], scalar_first=True)
    root = Rotation.from_quat(channels[:, 3:7], scalar_first=True)
    line = channels[:, at : at + 3] - end.apply(limb.points.mean(axis=0))
    line[:, 0] += stride * channels[:, at + 3]
    return line - channels[:, :3] - root.apply(limb.offsets[0])


def _shortest_rotations(u: Array, v: Array) -> Rotation:
    """Smallest rotations that turn directions u into v (n, 3), less than half a turn apart."""
    u, v = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (u, v))
    quaternions = np.concatenate([1.0 + np.sum(u * v, axis=1, keepdims=True), np.cross(u, v)], axis=1)
    return Rotation.from_quat(quaternions, scalar_first=True)
