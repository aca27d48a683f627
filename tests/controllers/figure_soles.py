"""Positions of a figure's sole points and how far they slide, by MuJoCo's kinematics."""

import mujoco
import numpy as np

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS


def soles(figure, poses):
    """Positions [m] of the contact points, shape (poses, points, 3)."""
    data, geoms = mujoco.MjData(figure), [figure.geom(name).id for name in FOOT_CONTACTS]
    positions = []
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(figure, data)
        positions.append(data.geom_xpos[geoms] - [0.0, 0.0, CONTACT_RADIUS])
    return np.array(positions)


def slide(positions, touch=0.003):
    """Largest distance [m] that a point moves over the floor while it is lower than `touch`."""
    worst = 0.0
    for point in range(positions.shape[1]):
        touchdown = None
        for position in positions[:, point]:
            if position[2] >= touch:
                touchdown = None
            elif touchdown is None:
                touchdown = position[:2]
            else:
                worst = max(worst, float(np.hypot(*(position[:2] - touchdown))))
    return worst
