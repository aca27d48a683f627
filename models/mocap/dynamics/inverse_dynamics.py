"""Inverse dynamics of many states of the figure without contacts, by MuJoCo."""

from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from models.humanoid.skeleton import N_TANGENT, figure_model


class SegmentPlaces(NamedTuple):
    """Segments of the figure in m states, in W, in the order of `BODIES`.

    Attributes
    ----------
    joints, centres : arrays, shape (m, 18, 3)
        Positions of the joints and of the centres of mass [m].
    frames, principal : arrays, shape (m, 18, 3, 3)
        Rotations of the segments and of their principal axes of inertia.
    """

    joints: Array
    centres: Array
    frames: Array
    principal: Array

    def of(self, states: npt.NDArray[np.intp]) -> "SegmentPlaces":
        """Those of some states."""
        return SegmentPlaces(*(field[states] for field in self))


def inverse_dynamics(q: Array, v: Array, a: Array) -> tuple[Array, SegmentPlaces]:
    """Generalised forces M a + c, joints' damping and motors' inertia included, shape (m, 57), and the segments.

    Parameters
    ----------
    q, v, a : arrays, shapes (m, 75), (m, 57), (m, 57)
        qpos, qvel and qacc.
    """
    model = figure_model()
    d = mujoco.MjData(model)
    m, segments = len(q), model.nbody - 1
    force = np.empty((m, N_TANGENT))
    places = SegmentPlaces(*(np.empty((m, segments, *shape)) for shape in ((3,), (3,), (3, 3), (3, 3))))
    is_new_pose = np.append(True, np.any(q[1:] != q[:-1], axis=1))  # states of one pose share its kinematics
    for k in range(m):
        d.qvel[:], d.qacc[:] = v[k], a[k]
        if is_new_pose[k]:
            d.qpos[:] = q[k]
            mujoco.mj_kinematics(model, d)
            mujoco.mj_comPos(model, d)
        mujoco.mj_comVel(model, d)
        mujoco.mj_rne(model, d, 1, force[k])
        places.joints[k], places.centres[k] = d.xpos[1:], d.xipos[1:]
        places.frames[k], places.principal[k] = d.xmat[1:].reshape(-1, 3, 3), d.ximat[1:].reshape(-1, 3, 3)
    return force + model.dof_damping * v + model.dof_armature * a, places
