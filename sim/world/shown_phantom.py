"""A Phantom that is only shown: its linkage is set kinematically to the configuration of a real or recorded hand."""

from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from geometry.arrays import Array, IntArray
from geometry.vectors import Triple
from models.phantom.kinematics import gimbal_angles, inverse_kinematics, linkage_angles, vector_to_device_frame
from models.phantom.spec import GIMBAL_JOINTS, LINKAGE_JOINTS
from models.world.scene import PHANTOM


class ShownPhantom(NamedTuple):
    """The linkage's joints in a world's state.

    Attributes
    ----------
    qpos, qvel : Array
        Views of the world's MjData.
    places, rates : IntArray
        Indices in them of θ1, θ2, θ3, elbow, twin and the gimbal's three joints, shape (8,).
    """

    qpos: Array
    qvel: Array
    places: IntArray
    rates: IntArray


def shown_phantom(model: mujoco.MjModel, data: mujoco.MjData) -> ShownPhantom:
    """The linkage of a world; the world must outlive it."""
    joints = [model.joint(PHANTOM + name) for name in (*LINKAGE_JOINTS, *GIMBAL_JOINTS)]
    places, rates = ([int(address[0]) for address in column] for column in zip(
        *((joint.qposadr, joint.dofadr) for joint in joints), strict=True
    ))  # fmt: skip
    return ShownPhantom(data.qpos, data.qvel, np.array(places), np.array(rates))


@njit
def show_angles(shown: ShownPhantom, theta: Triple, gimbal: Triple) -> None:
    """Put the linkage at joint angles [rad], at rest."""
    angles = linkage_angles(theta) + gimbal
    for i in range(8):
        shown.qpos[shown.places[i]] = angles[i]
        shown.qvel[shown.rates[i]] = 0.0


@njit
def show_hand(shown: ShownPhantom, p: Array, q: Array) -> None:
    """Put the stylus at a position in H [m], shape (3,), and orientation wxyz; if out of reach, it is not moved."""
    a, b, c, reachable = inverse_kinematics(vector_to_device_frame((p[0], p[1], p[2])))
    if reachable:
        show_angles(shown, (a, b, c), gimbal_angles((a, b, c), (q[0], q[1], q[2], q[3])))
