"""The Phantom's kinematics and dynamics in the form that certificates take."""

from typing import Any

import numpy as np

from controllers.certificates.loop.device import Device
from geometry.arrays import Array
from models.phantom.dynamics import coriolis_matrix, gravity_torques, mass_matrix
from models.phantom.kinematics import forward_kinematics, jacobian, vector_to_hand_frame
from models.phantom.parameters import PREMIUM_1_5
from sim.world.linkage import Linkage
from sim.world.world import phantom_angles


def phantom_device(linkage: Linkage | None = None) -> Device:
    """The Phantom's own kernels, on CasADi symbols, in H; friction and added joint inertia are those of a linkage."""

    def jacobian_H(theta: Any) -> Any:
        columns = zip(*jacobian.py_func(theta), strict=True)
        return tuple(zip(*(vector_to_hand_frame.py_func(column) for column in columns), strict=True))

    def mass(theta: Any) -> Any:
        rows = mass_matrix.py_func(theta)
        return tuple(tuple(m + (added[i] if i == j else 0.0) for j, m in enumerate(row)) for i, row in enumerate(rows))

    def numbers(theta: Array) -> tuple[Array, Array]:
        at = (float(theta[0]), float(theta[1]), float(theta[2]))
        columns = [vector_to_hand_frame(column) for column in zip(*jacobian(at), strict=True)]
        return np.array(vector_to_hand_frame(forward_kinematics(at))), np.array(columns).T

    p, found = PREMIUM_1_5, linkage or Linkage()
    added = found.inertia
    return Device(
        position=lambda theta: vector_to_hand_frame.py_func(forward_kinematics.py_func(theta)),
        jacobian=jacobian_H, mass=mass if any(added) else mass_matrix.py_func, coriolis=coriolis_matrix.py_func,
        gravity=gravity_torques.py_func, angles=phantom_angles, viscous=found.viscous,
        coulomb=found.coulomb, encoder_step=p.encoder_step, peak_torque=p.peak_torque,
        numbers=numbers,
    )  # fmt: skip
