"""The simulated Phantom's wires: what its encoders tell, and what its motors do."""

import math
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from numba import njit

from models.phantom.dynamics import gravity_torques
from models.phantom.kinematics import (
    encoder_reading,
    forward_kinematics,
    gimbal_reading,
    jacobian,
    joint_torques,
    stylus_axes,
    stylus_orientation,
    vector_to_device_frame,
    vector_to_hand_frame,
)
from models.phantom.parameters import PREMIUM_1_5
from models.scene import PHANTOM
from sim.errors import SimError

Array = npt.NDArray[np.float64]

ARM_JOINTS = ("theta1", "theta2", "theta3")
GIMBAL_JOINTS = ("gimbal1", "gimbal2", "gimbal3")
MOTORS = ("motor1", "motor2", "motor3")
PEAK_TORQUE = PREMIUM_1_5.peak_torque


class PhantomPort(NamedTuple):
    """The device as the compiled loop sees it.

    Attributes
    ----------
    qpos, qvel, ctrl, applied : Array
        Views of the world's MjData: positions, velocities, motor commands, external generalised forces.
    arm_q, arm_v, gimbal_q, gimbal_v, motor : tuple of three ints
        Where the device's joints and motors stand in them.
    period : float
        Servo period [s].
    smoothing : float
        Share of the old velocity that the velocity filter keeps each period.
    memory : Array
        Last angles (6) and filtered rates (6) of the joints and the gimbal, 1 when initialised: shape (13,).
    hand : Array
        The hand vector of `controllers.state`: t, p, quaternion, v, ω, switch; shape (15,).
    torque : Array
        Last commanded joint torques [N m], shape (3,).
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


def phantom_port(model: mujoco.MjModel, data: mujoco.MjData, period: float, cutoff: float) -> PhantomPort:
    """Wire up the Phantom of a compiled world.

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
    if not (math.isfinite(cutoff) and cutoff > 0.0):
        raise SimError(f"the velocity filter's cutoff is {cutoff} Hz; it must be positive")

    def place(names: tuple[str, ...], kind: str) -> tuple[int, int, int]:
        table = {"q": model.jnt_qposadr, "v": model.jnt_dofadr}
        if kind == "motor":
            a, b, c = (model.actuator(PHANTOM + name).id for name in names)
        else:
            a, b, c = (int(table[kind][model.joint(PHANTOM + name).id]) for name in names)
        return int(a), int(b), int(c)

    return PhantomPort(
        qpos=data.qpos, qvel=data.qvel, ctrl=data.ctrl, applied=data.qfrc_applied,
        arm_q=place(ARM_JOINTS, "q"), arm_v=place(ARM_JOINTS, "v"), gimbal_q=place(GIMBAL_JOINTS, "q"),
        gimbal_v=place(GIMBAL_JOINTS, "v"), motor=place(MOTORS, "motor"), period=period,
        smoothing=math.exp(-2.0 * math.pi * cutoff * period),
        memory=np.zeros(13), hand=np.zeros(15), torque=np.zeros(3),
    )  # fmt: skip


@njit
def sense(port: PhantomPort, t: float, switch: float) -> None:
    r"""Fill `port.hand` with what the encoders tell at time t.

    Joint rates are backward differences of the encoder angles through a first-order low-pass,
    ω_k = s ω_{k−1} + (1 − s) (θ_k − θ_{k−1})/T; the tip's velocity is J(θ) θ̇, its angular velocity the change of the
    stylus's orientation over the period through the same filter.
    """
    q, memory, hand = port.qpos, port.memory, port.hand
    a, g = port.arm_q, port.gimbal_q
    theta = encoder_reading((q[a[0]], q[a[1]], q[a[2]]))
    gimbal = gimbal_reading((q[g[0]], q[g[1]], q[g[2]]))
    orientation = stylus_orientation(theta, gimbal)
    keep = port.smoothing
    if memory[12] == 0.0:
        memory[12] = 1.0
        for i in range(3):
            memory[i] = theta[i]
        for i in range(4):
            hand[4 + i] = orientation[i]
    for i in range(3):
        memory[6 + i] = keep * memory[6 + i] + (1.0 - keep) * (theta[i] - memory[i]) / port.period
        memory[i] = theta[i]
    rate = (memory[6], memory[7], memory[8])
    j = jacobian(theta)
    p_H = vector_to_hand_frame(forward_kinematics(theta))
    v_H = vector_to_hand_frame(
        (
            j[0][0] * rate[0] + j[0][1] * rate[1] + j[0][2] * rate[2],
            j[1][0] * rate[0] + j[1][1] * rate[1] + j[1][2] * rate[2],
            j[2][0] * rate[0] + j[2][1] * rate[1] + j[2][2] * rate[2],
        )
    )
    _turn_rate(hand, orientation, keep, port.period)
    hand[0] = t
    for i in range(3):
        hand[1 + i] = p_H[i]
        hand[8 + i] = v_H[i]
    for i in range(4):
        hand[4 + i] = orientation[i]
    hand[14] = switch


def sense_in_motion(port: PhantomPort) -> None:
    """Let a device whose joints move begin as if it had been sensed before: its velocity is known from the first tick.

    Else a field takes the hand for one that rests, and pushes it on.
    """
    a, g = port.arm_q, port.gimbal_q
    for i in range(3):
        port.memory[6 + i] = port.qvel[port.arm_v[i]]
    theta = port.qpos[list(a)]
    port.memory[:3] = encoder_reading.py_func(theta - port.period * port.memory[6:9])
    port.hand[4:8] = stylus_orientation.py_func(
        encoder_reading.py_func(theta), gimbal_reading.py_func(port.qpos[list(g)])
    )
    port.hand[0], port.memory[12] = -port.period, 1.0


@njit
def has_sensed(port: PhantomPort) -> bool:
    """Whether `sense` has been called before."""
    return port.memory[12] != 0.0


@njit
def _turn_rate(hand: Array, q: tuple[float, float, float, float], keep: float, period: float) -> None:
    """Filter the angular velocity in H: 2 vec(q q_last*) / T, for the small turn of one period."""
    w, x, y, z = hand[4], -hand[5], -hand[6], -hand[7]
    scalar = q[0] * w - q[1] * x - q[2] * y - q[3] * z
    sign = 2.0 / period if scalar >= 0.0 else -2.0 / period
    turn = (
        q[0] * x + q[1] * w + q[2] * z - q[3] * y,
        q[0] * y - q[1] * z + q[2] * w + q[3] * x,
        q[0] * z + q[1] * y - q[2] * x + q[3] * w,
    )
    for i in range(3):
        hand[11 + i] = keep * hand[11 + i] + (1.0 - keep) * sign * turn[i]


@njit
def actuate(port: PhantomPort, force: Array) -> None:
    """Turn a force on the hand into motor torques: τ = J(θ)ᵀ F + N(θ), within ± the peak torque.

    N balances the linkage's own weight, so a commanded force of zero leaves the stylus floating.

    Parameters
    ----------
    port : PhantomPort
        `torque` and the world's `ctrl` are set.
    force : Array
        In H [N], shape (3,).
    """
    theta = (port.memory[0], port.memory[1], port.memory[2])
    torque = joint_torques(theta, vector_to_device_frame((force[0], force[1], force[2])))
    weight = gravity_torques(theta)
    for i in range(3):
        port.torque[i] = min(PEAK_TORQUE[i], max(-PEAK_TORQUE[i], torque[i] + weight[i]))
        port.ctrl[port.motor[i]] = port.torque[i]


@njit
def true_motion(port: PhantomPort, p: Array, v: Array, jacobian_H: Array) -> None:
    """Where the stylus really is and how it moves, in H: what the hand feels, unquantised.

    Parameters
    ----------
    port : PhantomPort
        Read only.
    p, v : Array
        Set: position [m] and velocity [m/s], shape (3,).
    jacobian_H : Array
        Set: ∂p_H/∂θ at the true angles, shape (3, 3).
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
    """How the stylus is really turned and turning, in H: what the fingers feel, unquantised.

    Parameters
    ----------
    port : PhantomPort
        Read only.
    orientation, spin : Array
        Set: R_H as a unit quaternion wxyz, shape (4,), and ω [rad/s], shape (3,).
    axes : Array
        Set: unit vectors about which the three gimbal joints turn it, columns, shape (3, 3).
    """
    q, v, a, g = port.qpos, port.qvel, port.arm_q, port.gimbal_q
    theta, gimbal = (q[a[0]], q[a[1]], q[a[2]]), (q[g[0]], q[g[1]], q[g[2]])
    turret, forearm, first, second, third = stylus_axes(theta, gimbal)
    r, t, n = v[port.arm_v[0]], v[port.arm_v[2]], port.gimbal_v
    for i in range(3):
        axes[i, 0], axes[i, 1], axes[i, 2] = first[i], second[i], third[i]
        spin[i] = r * turret[i] + t * forearm[i] + v[n[0]] * first[i] + v[n[1]] * second[i] + v[n[2]] * third[i]
    orientation[0], orientation[1], orientation[2], orientation[3] = stylus_orientation(theta, gimbal)
