"""Encoders and motors of the simulated Phantom: the link between the compiled loop and MuJoCo's state."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.safety.faults import HELD, NO_SEQUENCE, elapsed, judge_reading
from controllers.state import HAND_QUATERNION, HAND_SIZE, HAND_TIME
from geometry.arrays import Array
from models.phantom.kinematics import (
    encoder_reading,
    forward_kinematics,
    gimbal_reading,
    jacobian,
    stylus_axes,
    stylus_orientation,
    vector_to_hand_frame,
)
from models.phantom.spec import GIMBAL_JOINTS, MOTOR_JOINTS, MOTORS
from models.world.scene import PHANTOM
from sim.errors import SimError
from sim.world.encoders import ANGLES, MEMORY_SIZE, RATES, SENSED, motor_torques, plausibility, take_reading


class PhantomPort(NamedTuple):
    """The device as the compiled loop sees it.

    Attributes
    ----------
    qpos, qvel, ctrl, applied : Array
        Views of the world's MjData: positions, velocities, motor commands, external generalised forces.
    arm_q, arm_v, gimbal_q, gimbal_v, motor : tuple of three ints
        Indices of the device's joints and motors in these arrays.
    period : float
        Servo period [s].
    smoothing : float
        Share of the old velocity that the velocity filter keeps each period.
    memory : Array
        Memory of the velocity filter, shape (13,); see `sim.world.encoders.ANGLES`.
    hand : Array
        The hand vector of `controllers.state`: t, p, quaternion, v, ω, switch; shape (15,).
    torque : Array
        Last commanded joint torques [N m], shape (3,).
    faults : Array
        Latched faults of its readings and commands (`controllers.safety.faults`).
    """

    qpos: Array
    qvel: Array
    ctrl: Array
    applied: Array
    arm_q: tuple[int, int, int]
    arm_v: tuple[int, int, int]
    gimbal_q: tuple[int, int, int]
    gimbal_v: tuple[int, int, int]
    motor: tuple[int, int, int]
    period: float
    smoothing: float
    memory: Array
    hand: Array
    torque: Array
    faults: Array


def velocity_smoothing(cutoff: float, period: float) -> float:
    """Share of the old velocity that a first-order low-pass of cutoff frequency [Hz] keeps each period [s].

    Raises
    ------
    SimError
        If the cutoff is not positive and finite.
    """
    if not (math.isfinite(cutoff) and cutoff > 0.0):
        raise SimError(f"the velocity filter's cutoff is {cutoff} Hz; it must be positive")
    return math.exp(-2.0 * math.pi * cutoff * period)


def phantom_port(model: mujoco.MjModel, data: mujoco.MjData, period: float, cutoff: float) -> PhantomPort:
    """Connect to the Phantom of a compiled world.

    Parameters
    ----------
    model, data
        The world.
    period : float
        Servo period [s].
    cutoff : float
        Corner frequency of the first-order velocity filter [Hz].

    Raises
    ------
    SimError
        If the cutoff is not positive and finite.
    """

    def three(numbers: Iterable[int]) -> tuple[int, int, int]:
        a, b, c = map(int, numbers)
        return a, b, c

    arm, gimbal = ([model.joint(PHANTOM + name).id for name in names] for names in (MOTOR_JOINTS, GIMBAL_JOINTS))
    hand = np.zeros(HAND_SIZE)
    hand[HAND_QUATERNION] = 1.0
    return PhantomPort(
        qpos=data.qpos, qvel=data.qvel, ctrl=data.ctrl, applied=data.qfrc_applied,
        arm_q=three(model.jnt_qposadr[arm]), arm_v=three(model.jnt_dofadr[arm]),
        gimbal_q=three(model.jnt_qposadr[gimbal]), gimbal_v=three(model.jnt_dofadr[gimbal]),
        motor=three(model.actuator(PHANTOM + name).id for name in MOTORS), period=period,
        smoothing=velocity_smoothing(cutoff, period),
        memory=np.zeros(MEMORY_SIZE), hand=hand, torque=np.zeros(3), faults=plausibility(period).fresh(),
    )  # fmt: skip


@njit
def sense(port: PhantomPort, t: float, switch: float) -> None:
    """Fill `port.hand` from the encoders at time t (see `take_reading`)."""
    q, a, g = port.qpos, port.arm_q, port.gimbal_q
    theta = encoder_reading((q[a[0]], q[a[1]], q[a[2]]))
    gimbal = gimbal_reading((q[g[0]], q[g[1]], q[g[2]]))
    # A real hand trembles, so constant readings are a fault; a simulated hand with the switch pressed may hold still.
    verdict = judge_reading(port.faults, theta, gimbal, port.memory, t, t, NO_SEQUENCE, switch > 0.0)
    if verdict == HELD:
        port.hand[HAND_TIME] = t
    else:
        take_reading(port.hand, port.memory, port.smoothing, elapsed(port.faults), theta, gimbal, t, switch, verdict)


def sense_in_motion(port: PhantomPort) -> None:
    """Initialise the velocity filter of a device whose joints move, as if it had been sensed one period before.

    Otherwise the first ticks would show a hand at rest, and a field would accelerate it.
    """
    theta, rate = port.qpos[list(port.arm_q)], port.qvel[list(port.arm_v)]
    orientation = stylus_orientation.py_func(
        encoder_reading.py_func(theta), gimbal_reading.py_func(port.qpos[list(port.gimbal_q)])
    )
    sensed_before(port, encoder_reading.py_func(theta - port.period * rate), rate, orientation)
    port.hand[HAND_TIME] = -port.period


def sensed_before(
    port: PhantomPort, theta: npt.ArrayLike, rate: npt.ArrayLike, orientation: npt.ArrayLike = (1.0, 0.0, 0.0, 0.0)
) -> None:
    """Set the velocity filter's last angles [rad] and rates [rad/s], shape (3,) each, and the last orientation."""
    port.memory[ANGLES : ANGLES + 3], port.memory[RATES : RATES + 3], port.memory[SENSED] = theta, rate, 1.0
    port.hand[HAND_QUATERNION : HAND_QUATERNION + 4] = orientation


@njit
def has_sensed(port: PhantomPort) -> bool:
    """Whether a reading has been taken before."""
    return port.memory[SENSED] != 0.0


@njit
def actuate(port: PhantomPort, force: Array) -> None:
    """Turn a force on the hand into motor torques (see `motor_torques`).

    Parameters
    ----------
    port : PhantomPort
        `torque` and the world's `ctrl` are set.
    force : Array
        In H [N], shape (3,).
    """
    motor_torques(port.faults, port.memory, port.hand[HAND_TIME], force, port.torque)
    for i in range(3):
        port.ctrl[port.motor[i]] = port.torque[i]


@njit
def let_go(port: PhantomPort) -> None:
    """Switch the motors off."""
    for i in range(3):
        port.torque[i] = port.ctrl[port.motor[i]] = 0.0


@njit
def true_motion(port: PhantomPort, p: Array, v: Array, jacobian_H: Array) -> None:
    """True position and velocity of the stylus in H, unquantised, as the hand feels them.

    Parameters
    ----------
    port : PhantomPort
        Read only.
    p, v : Array
        Written: position [m] and velocity [m/s], shape (3,).
    jacobian_H : Array
        Written: ∂p_H/∂θ at the true angles, shape (3, 3).
    """
    q, a, b = port.qpos, port.arm_q, port.arm_v
    theta = (q[a[0]], q[a[1]], q[a[2]])
    rate = (port.qvel[b[0]], port.qvel[b[1]], port.qvel[b[2]])
    p_H = vector_to_hand_frame(forward_kinematics(theta))
    j = jacobian(theta)
    for i in range(3):
        column = vector_to_hand_frame((j[0][i], j[1][i], j[2][i]))
        for k in range(3):
            jacobian_H[k, i] = column[k]
    for k in range(3):
        p[k] = p_H[k]
        v[k] = jacobian_H[k, 0] * rate[0] + jacobian_H[k, 1] * rate[1] + jacobian_H[k, 2] * rate[2]


@njit
def true_turn(port: PhantomPort, orientation: Array, spin: Array, axes: Array) -> None:
    """True orientation and angular velocity of the stylus in H, unquantised, as the fingers feel them.

    Parameters
    ----------
    port : PhantomPort
        Read only.
    orientation, spin : Array
        Written: R_H as a unit quaternion wxyz, shape (4,), and ω [rad/s], shape (3,).
    axes : Array
        Written: unit vectors of the three gimbal joints' axes, columns, shape (3, 3).
    """
    q, v, a, g = port.qpos, port.qvel, port.arm_q, port.gimbal_q
    theta, gimbal = (q[a[0]], q[a[1]], q[a[2]]), (q[g[0]], q[g[1]], q[g[2]])
    turret, forearm, first, second, third = stylus_axes(theta, gimbal)
    r, t, n = v[port.arm_v[0]], v[port.arm_v[2]], port.gimbal_v
    for i in range(3):
        axes[i, 0], axes[i, 1], axes[i, 2] = first[i], second[i], third[i]
        spin[i] = r * turret[i] + t * forearm[i] + v[n[0]] * first[i] + v[n[1]] * second[i] + v[n[2]] * third[i]
    orientation[0], orientation[1], orientation[2], orientation[3] = stylus_orientation(theta, gimbal)
