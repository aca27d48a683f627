"""Forward kinematics: rotations and positions of the figure's segments, and centres of its contact spheres."""

import mujoco
import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS, SEGMENTS, figure_model


def global_rotations(poses: Array) -> Array:
    """R_WS of the 18 segments from MuJoCo's qpos, shape (n, 75) → (n, 18, 4)."""
    local = poses[:, 3:].reshape(len(poses), -1, 4)
    world = local.copy()
    for index, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            world[:, index] = quaternions.product(world[:, segment.parent], local[:, index])
    return world


def segment_positions(root: Array, rotations: Array, figure: mujoco.MjModel | None = None) -> Array:
    """Origins of the 18 segments in W [m], from the root's (n, 3) and `global_rotations` (n, 18, 4); (n, 18, 3).

    The figure is the default one, unless its model is given.
    """
    figure = figure or figure_model()
    positions = np.empty((len(root), len(SEGMENTS), 3))
    positions[:, 0] = root
    for index, segment in enumerate(SEGMENTS[1:], start=1):
        offset = quaternions.rotated(rotations[:, segment.parent], figure.body(BODIES[index]).pos)
        positions[:, index] = positions[:, segment.parent] + offset
    return positions


def sole_points(poses: Array) -> Array:
    """Centres of the 8 contact spheres of the feet in the world [m], shape (n, 8, 3)."""
    return contact_points(poses, FOOT_CONTACTS)


def contact_points(poses: Array, names: tuple[str, ...], figure: mujoco.MjModel | None = None) -> Array:
    """Centres of named contact spheres in the world [m], shape (n, k, 3); the figure is the default one, or given."""
    figure = figure or figure_model()
    data = mujoco.MjData(figure)
    spheres = [int(figure.geom(name).id) for name in names]
    points = np.empty((len(poses), len(spheres), 3))
    for k, pose in enumerate(poses):
        data.qpos = pose
        mujoco.mj_kinematics(figure, data)
        points[k] = data.geom_xpos[spheres]
    return points


def contact_rotations(poses: Array, names: tuple[str, ...]) -> Array:
    """Rotations in the world of the segments that bear named contact spheres, shape (n, k, 4)."""
    figure = figure_model()
    return global_rotations(poses)[:, [int(figure.geom(name).bodyid[0]) - 1 for name in names]]
