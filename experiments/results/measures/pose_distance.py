r"""Distances between poses of two animations: geodesic in D = R³ × SO(3)^18, and in space as an observer sees it."""

import mujoco
import numpy as np

from geometry.arrays import Array
from models.mocap.motion.clip import pose_difference
from models.mocap.motion.kinematics import global_rotations, segment_positions

ROOT_WEIGHT = 1.0  # [rad/m] weight of the root's displacement in the product metric


def geodesic_distance(poses: Array, others: Array) -> Array:
    r"""Length of the shortest path in D between poses, shapes (n, 75) → (n,) [rad].

    .. math:: d(q, q')^2 = (x - x')^2 + \sum_{i=1}^{18} |\log(R_i^{-1} R_i')|^2

    D = R³ × SO(3)^18 is the configuration space of the paper's figure (section 2.2): position and rotation of the root,
    and 17 joints. A product metric needs a length for an angle: here a metre counts as a radian.
    """
    difference = pose_difference(poses, others)
    difference[:, :3] *= ROOT_WEIGHT
    return np.linalg.norm(difference, axis=1)


def seen_distance(poses: Array, others: Array, figure: mujoco.MjModel) -> Array:
    """RMS over the 18 segments of the distance between their origins in space, shapes (n, 75) → (n,) [m]."""
    places = [segment_positions(each[:, :3], global_rotations(each), figure) for each in (poses, others)]
    apart = places[0] - places[1]
    return np.sqrt(np.mean(np.sum(apart**2, axis=2), axis=1))
