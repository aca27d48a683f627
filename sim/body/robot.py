r"""Computed-torque control of a robot arm that tracks the reference, in one world with the Phantom.

.. math:: \tau = M(q)\,\bigl(a_r + 2\omega\,(v_r - v) + \omega^2\,(q_r - q)\bigr) + c(q, v) - \tau_{passive}

saturated at the motors' limits. c holds Coriolis, centrifugal and gravity torques. The error decays with a double pole
at −ω as long as no motor saturates (Craig, Introduction to Robotics, chapter 10).
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from geometry.arrays import Array
from models.robot_arm.spec import ARM_JOINTS, TOOL
from models.world.scene import PEDESTAL, ROBOT
from sim.compilation.native import mj_full_m
from sim.errors import SimError
from sim.world.world import World

REPORT_SATURATED, REPORT_SIZE = 1, 8  # as in the figure's report


class RobotState(NamedTuple):
    """Views of the world's MjData, restricted to the arm, and scratch memory.

    Attributes
    ----------
    model, data : int
        Addresses of the world.
    qpos, qvel, bias, passive, ctrl : Array
        The arm's part of the world's arrays, shape (7,) each.
    applied : Array
        External forces that the control applies: none, shape (0,).
    world_M : Array
        Mass matrix of the world, shape (nv, nv).
    M : Array
        View of the arm's part of it, shape (7, 7).
    rate : float
        ω [1/s].
    torque_limit : Array
        [N m], shape (7,).
    acceleration : Array
        Wanted joint accelerations [rad/s²], shape (7,).
    report : Array
        Number of saturated motors at `REPORT_SATURATED`, shape (8,).
    """

    model: int
    data: int
    qpos: Array
    qvel: Array
    bias: Array
    passive: Array
    ctrl: Array
    applied: Array
    world_M: Array
    M: Array
    rate: float
    torque_limit: Array
    acceleration: Array
    report: Array


@njit
def robot_torque(s: RobotState, q_r: Array, v_r: Array, a_r: Array) -> None:
    """Set the motors' torques for the reference's joint angles [rad], velocities and accelerations, shape (7,) each."""
    mj_full_m(s.model, s.data, s.world_M.ctypes)
    n = s.qpos.shape[0]
    saturated = 0
    for i in range(n):
        s.acceleration[i] = a_r[i] + 2.0 * s.rate * (v_r[i] - s.qvel[i]) + s.rate**2 * (q_r[i] - s.qpos[i])
    for i in range(n):
        torque = s.bias[i] - s.passive[i]
        for j in range(n):
            torque += s.M[i, j] * s.acceleration[j]
        limit = s.torque_limit[i]
        saturated += abs(torque) > limit
        s.ctrl[i] = min(limit, max(-limit, torque))
    s.report[REPORT_SATURATED] = saturated


def robot_state(world: World, rate: float) -> RobotState:
    """The state of the arm's control.

    Parameters
    ----------
    world : World
        Must outlive the state, which holds addresses of its memory.
    rate : float
        ω [1/s].

    Raises
    ------
    SimError
        If the rate is not positive and finite.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise SimError(f"the arm's rate is {rate} 1/s; expected a positive, finite number")
    model, data, n = world.model, world.data, len(ARM_JOINTS)
    joint, motor = model.joint(ROBOT + ARM_JOINTS[0]), int(model.actuator(ROBOT + ARM_JOINTS[0]).id)
    qpos, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    dofs, motors = slice(dof, dof + n), slice(motor, motor + n)
    world_M = np.zeros((model.nv, model.nv))
    return RobotState(
        model=model._address, data=data._address, qpos=data.qpos[qpos : qpos + n], qvel=data.qvel[dofs],
        bias=data.qfrc_bias[dofs], passive=data.qfrc_passive[dofs], ctrl=data.ctrl[motors], applied=np.zeros(0),
        world_M=world_M, M=world_M[dofs, dofs], rate=float(rate),
        torque_limit=model.actuator_ctrlrange[motors, 1].copy(), acceleration=np.zeros(n), report=np.zeros(REPORT_SIZE),
    )  # fmt: skip


def tool_positions(arm: mujoco.MjModel, data: mujoco.MjData, angles: Array) -> Array:
    """Positions of the tool in the world [m], shape (n, 3), at joint angles [rad], shape (n, 7).

    `arm` is the model of the arm alone, `data` scratch memory of it.
    """
    positions = np.empty((len(angles), 3))
    for i, q in enumerate(angles):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm, data)
        positions[i] = data.site(TOOL).xpos
    positions[:, 2] += PEDESTAL
    return positions
