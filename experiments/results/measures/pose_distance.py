r"""Distances between poses of two animations: geodesic in D = R³ × SO(3)^18, and in space as an observer sees it."""

import mujoco
import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, SEGMENTS
from models.mocap.motion.clip import global_rotations, pose_difference

METRE = 1.0  # [rad/m] weight of the root's displacement in the product metric


def geodesic_distance(poses: Array, others: Array) -> Array:
    r"""Length of the shortest path in D between poses, shapes (n, 75) → (n,) [rad].

    .. math:: d(q, q')^2 = (x - x')^2 + \sum_{i=1}^{18} |\log(R_i^{-1} R_i')|^2

    D = R³ × SO(3)^18 is the configuration space of the paper's figure (section 2.2): position and rotation of the root,
    and 17 joints. A product metric needs a length for an angle: here a metre counts as a radian.
    """
    difference = pose_difference(poses, others)
    difference[:, :3] *= METRE
    return np.linalg.norm(difference, axis=1)


def seen_distance(poses: Array, others: Array, figure: mujoco.MjModel) -> Array:
    """RMS over the 18 segments of the distance between their origins in space, shapes (n, 75) → (n,) [m]."""
    apart = segment_places(poses, figure) - segment_places(others, figure)
    return np.sqrt(np.mean(np.sum(apart**2, axis=2), axis=1))


def segment_places(poses: Array, figure: mujoco.MjModel) -> Array:
    """Origins of the 18 segments in W by vectorised forward kinematics, shapes (n, 75) → (n, 18, 3) [m]."""
    rotations = global_rotations(poses)
    places = np.empty((len(poses), len(SEGMENTS), 3))
    for index, segment in enumerate(SEGMENTS):
        if segment.parent < 0:
            places[:, index] = poses[:, :3]
            continue
        offset = np.broadcast_to(figure.body(BODIES[index]).pos, (len(poses), 3))
        places[:, index] = places[:, segment.parent] + quaternions.rotated(rotations[:, segment.parent], offset)
    return places
