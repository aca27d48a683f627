r"""How far apart two animations are: as a distance in D = R³ × SO(3)^18, and as a person sees it."""

import mujoco
import numpy as np

from controllers.state import Array
from models.humanoid.skeleton import BODIES, SEGMENTS
from models.mocap import quaternions
from models.mocap.clip import global_rotations, pose_difference

METRE = 1.0  # [rad] that a metre of the root's way counts for, in the product's metric


def geodesic_distance(poses: Array, others: Array) -> Array:
    r"""Length of the shortest path in D between poses, shapes (n, 75) → (n,) [rad].

    .. math:: d(q, q')^2 = (x - x')^2 + \sum_{i=1}^{18} |\log(R_i^{-1} R_i')|^2

    D = R³ × SO(3)^18 is the configuration space of the paper's figure (section 2.2): the root's place and rotation, and
    17 joints. A product of metrics needs one length for an angle: a metre counts as a radian.
    """
    difference = pose_difference(poses, others)
    difference[:, :3] *= METRE
    return np.linalg.norm(difference, axis=1)


def seen_distance(poses: Array, others: Array, figure: mujoco.MjModel) -> Array:
    """Root mean square over the 18 segments of how far apart their origins are in space, (n, 75) → (n,) [m]."""
    apart = segment_places(poses, figure) - segment_places(others, figure)
    return np.sqrt(np.mean(np.sum(apart**2, axis=2), axis=1))


def segment_places(poses: Array, figure: mujoco.MjModel) -> Array:
    """Origins of the 18 segments in the world, (n, 75) → (n, 18, 3) [m]: MuJoCo's forward kinematics, all at once."""
    rotations = global_rotations(poses)
    places = np.empty((len(poses), len(SEGMENTS), 3))
    for index, segment in enumerate(SEGMENTS):
        if segment.parent < 0:
            places[:, index] = poses[:, :3]
            continue
        offset = np.broadcast_to(figure.body(BODIES[index]).pos, (len(poses), 3))
        places[:, index] = places[:, segment.parent] + quaternions.rotated(rotations[:, segment.parent], offset)
    return places
