"""The Phantom as certificates know it."""

from typing import Any

from controllers.certificates.loop.device import Device
from models.phantom.dynamics import coriolis_matrix, gravity_torques, mass_matrix
from models.phantom.kinematics import forward_kinematics, jacobian, vector_to_hand_frame
from models.phantom.parameters import PREMIUM_1_5
from sim.world.world import phantom_angles


def phantom_device() -> Device:
    """Its own kernels, on symbols, in the hand frame."""

    def jacobian_H(theta: Any) -> Any:
        columns = zip(*jacobian.py_func(theta), strict=True)
        return tuple(zip(*(vector_to_hand_frame.py_func(column) for column in columns), strict=True))

    p = PREMIUM_1_5
    return Device(
        position=lambda theta: vector_to_hand_frame.py_func(forward_kinematics.py_func(theta)),
        jacobian=jacobian_H, mass=mass_matrix.py_func, coriolis=coriolis_matrix.py_func,
        gravity=gravity_torques.py_func, angles=phantom_angles, viscous=p.viscous_friction,
        coulomb=p.coulomb_friction, encoder_step=p.encoder_step, peak_torque=p.peak_torque,
    )  # fmt: skip
