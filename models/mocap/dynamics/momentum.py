"""Centre of mass, angular momentum and inertia of a clip, frame by frame."""

from typing import NamedTuple

import mujoco
import numpy as np

from geometry.arrays import Array
from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import Clip


class Momentum(NamedTuple):
    """Motion of the whole body in the world over n frames.

    Attributes
    ----------
    com : array, shape (n, 3)
        Centre of mass [m].
    angular : array, shape (n, 3)
        Angular momentum about the centre of mass [kg m²/s].
    inertia : array, shape (n, 3, 3)
        Composite inertia of the pose as a rigid body about the centre of mass [kg m²].
    """

    com: Array
    angular: Array
    inertia: Array


def momentum(clip: Clip) -> Momentum:
    """Centre of mass, angular momentum and inertia of a clip on the default figure, by finite differences in time."""
    model = figure_model()
    data = mujoco.MjData(model)
    pelvis, bodies = model.body("pelvis").id, slice(1, model.nbody)
    com, angular, inertia = (np.empty((clip.n_frames, *shape)) for shape in ((3,), (3,), (3, 3)))
    for k, (pose, velocity) in enumerate(zip(clip.poses, clip.velocities(), strict=True)):
        data.qpos, data.qvel = pose, velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        com[k], angular[k] = data.subtree_com[pelvis], data.subtree_angmom[pelvis]
        R = data.ximat[bodies].reshape(-1, 3, 3)
        arm = data.xipos[bodies] - com[k]
        own = np.einsum("bij,bj,bkj->ik", R, model.body_inertia[bodies], R)
        steiner = np.einsum("b,bi,bj->ij", model.body_mass[bodies], arm, arm)
        inertia[k] = own + np.trace(steiner) * np.eye(3) - steiner
    return Momentum(com, angular, inertia)
