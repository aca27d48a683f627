"""Where a figure's soles are, and how far they slide, by MuJoCo's own kinematics."""

import mujoco
import numpy as np

from models.humanoid.skeleton import CONTACT_RADIUS, FOOT_CONTACTS


def soles(figure, poses):
    data, geoms = mujoco.MjData(figure), [figure.geom(name).id for name in FOOT_CONTACTS]
    places = []
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(figure, data)
        places.append(data.geom_xpos[geoms] - [0.0, 0.0, CONTACT_RADIUS])
    return np.array(places)


def slide(places, touch=0.003):
    worst = 0.0
    for point in range(places.shape[1]):
        since = None
        for place in places[:, point]:
            if place[2] >= touch:
                since = None
            elif since is None:
                since = place[:2]
            else:
                worst = max(worst, float(np.hypot(*(place[:2] - since))))
    return worst
