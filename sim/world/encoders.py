r"""The Phantom's kinematics in the loop: from joint angles to the hand vector, and from a force to motor torques.

The simulated device and a real one share this code; they differ only in the source of angles and the sink of torques.
"""

import math
from typing import Any

import numpy as np
from numba import njit

from controllers.safety.faults import FAULT_CODE, FORCE_NOT_FINITE, RESTARTED, Plausibility, latch, note_command
from controllers.state import (
    HAND_ANGULAR_VELOCITY,
    HAND_POSITION,
    HAND_QUATERNION,
    HAND_SWITCH,
    HAND_TIME,
    HAND_VELOCITY,
)
from geometry.arrays import Array
from geometry.rotations import multiply
from geometry.vectors import Triple, dot
from models.phantom.dynamics import gravity_torques, mass_matrix
from models.phantom.kinematics import (
    ENCODER_STEP,
    forward_kinematics,
    jacobian,
    joint_torques,
    stylus_orientation,
    vector_to_device_frame,
    vector_to_hand_frame,
)
from models.phantom.parameters import PREMIUM_1_5

PEAK_TORQUE = PREMIUM_1_5.peak_torque
COULOMB_FRICTION = PREMIUM_1_5.coulomb_friction
ANGLES, RATES, SENSED, MEMORY_SIZE = 0, 6, 12, 13
"""Places in the velocity filter's memory: last angles (6, those of the gimbal unused), filtered rates (6), 1 once a
reading was taken."""
SILENT_PERIODS = 5
"""Servo periods without a reading or a command after which the motors are switched off. At 1 kHz a hand at 0.5 m/s
moves 2.5 mm in this time, which changes the force of a spring of 500 N/m by 1.3 N; shorter delays of a bus or of the
operating system do not justify a loss of force."""


def max_rates() -> Triple:
    r"""Upper bound of the joint rates [rad/s]: from stop to stop under the peak torque, :math:`\sqrt{2 P \Delta/M}`.

    Friction is neglected and the least inertia M_ii of the workspace is used, so no motor reaches these rates; nor does
    a hand, for which they would mean 10 m/s and more at the tip.
    """
    ranges = PREMIUM_1_5.limit
    mass_matrix_of: Any = mass_matrix.py_func
    inertia = mass_matrix_of((0.0, *np.meshgrid(*(np.linspace(*ranges[i], 61) for i in (1, 2)))))
    min_inertia = [np.min(inertia[i][i]) for i in range(3)]
    first, second, third = (
        math.sqrt(2.0 * peak * (high - low) / inertia_i)
        for peak, (low, high), inertia_i in zip(PEAK_TORQUE, ranges, min_inertia, strict=True)
    )
    return first, second, third


TOP_RATES = max_rates()


def plausibility(period: float, silent: float = SILENT_PERIODS) -> Plausibility:
    """Plausibility limits of a Phantom's readings at a servo period [s]; `silent` is the watchdog time in periods."""
    return Plausibility(period, TOP_RATES, ENCODER_STEP, silent * period)


@njit
def take_reading(  # noqa: PLR0913 - a kernel takes angles and memory one by one
    hand: Array,
    memory: Array,
    keep: float,
    period: float,
    theta: Triple,
    gimbal: Triple,
    t: float,
    switch: float,
    verdict: int,
) -> None:
    r"""Fill a hand vector from joint angles read at time t.

    Joint rates are backward differences of the encoder angles through a first-order low-pass,
    ω_k = s ω_{k−1} + (1 − s) (θ_k − θ_{k−1})/T; the tip's velocity is J(θ) θ̇, its angular velocity the change of the
    stylus's orientation over the period through the same filter.

    Parameters
    ----------
    hand, memory : Array
        The hand vector and the filter's memory, of `MEMORY_SIZE`; written.
    keep, period : float
        s, and T or the time since the last reading [s].
    theta, gimbal : three floats each
        [rad]
    t, switch : float
        Time [s], and 1 while the switch is pressed.
    verdict : int
        Result of `controllers.safety.faults.judge_reading`; `RESTARTED` resets the velocity filter.
    """
    orientation = stylus_orientation(theta, gimbal)
    if verdict == RESTARTED:
        memory[RATES:MEMORY_SIZE] = 0.0
        hand[HAND_ANGULAR_VELOCITY:HAND_SWITCH] = 0.0
    if memory[SENSED] == 0.0:
        memory[SENSED] = 1.0
        for i in range(3):
            memory[ANGLES + i] = theta[i]
        for i in range(4):
            hand[HAND_QUATERNION + i] = orientation[i]
    rates, j = _update_joint_rates(memory, theta, keep, period), jacobian(theta)
    p_H = vector_to_hand_frame(forward_kinematics(theta))
    v_H = vector_to_hand_frame((dot(j[0], rates), dot(j[1], rates), dot(j[2], rates)))
    _update_angular_velocity(hand, orientation, keep, period)
    hand[HAND_TIME] = t
    for i in range(3):
        hand[HAND_POSITION + i] = p_H[i]
        hand[HAND_VELOCITY + i] = v_H[i]
    for i in range(4):
        hand[HAND_QUATERNION + i] = orientation[i]
    hand[HAND_SWITCH] = switch


@njit
def _update_joint_rates(memory: Array, theta: Triple, keep: float, period: float) -> Triple:
    """Low-pass the backward differences of the joint angles, and store the angles; returns the rates [rad/s]."""
    for i in range(3):
        memory[RATES + i] = keep * memory[RATES + i] + (1.0 - keep) * (theta[i] - memory[ANGLES + i]) / period
        memory[ANGLES + i] = theta[i]
    return memory[RATES], memory[RATES + 1], memory[RATES + 2]


@njit
def _update_angular_velocity(hand: Array, q: tuple[float, float, float, float], keep: float, period: float) -> None:
    """Low-pass the angular velocity in H, 2 vec(q q̄_last) / T for the small rotation of one period."""
    last = HAND_QUATERNION
    turn = multiply(q[0], q[1], q[2], q[3], hand[last], -hand[last + 1], -hand[last + 2], -hand[last + 3])
    sign = 2.0 / period if turn[0] >= 0.0 else -2.0 / period
    for i in range(3):
        rate = HAND_ANGULAR_VELOCITY + i
        hand[rate] = keep * hand[rate] + (1.0 - keep) * sign * turn[1 + i]


@njit
def motor_torques(faults: Array, memory: Array, t: float, force: Array, torque: Array) -> None:
    """Joint torques for a force on the hand: τ = J(θ)ᵀ F + N(θ), limited to ± the peak torque; zero after a fault.

    N compensates for the linkage's weight, so with a commanded force of zero the stylus floats.

    Parameters
    ----------
    faults : Array
        Fault memory of the device; a force that is not finite is latched.
    memory : Array
        Memory of `take_reading`, which holds θ.
    t : float
        Time of the command [s].
    force : Array
        In H [N], shape (3,).
    torque : Array
        Written [N m], shape (3,).
    """
    theta = (memory[ANGLES], memory[ANGLES + 1], memory[ANGLES + 2])
    force_torque = joint_torques(theta, vector_to_device_frame((force[0], force[1], force[2])))
    gravity = gravity_torques(theta)
    total = force_torque[0] + force_torque[1] + force_torque[2]
    if not np.isfinite(total):
        latch(faults, FORCE_NOT_FINITE, t, force[0] + force[1] + force[2])
    load = 0.0
    for i in range(3):
        load = max(load, abs(force_torque[i]) / COULOMB_FRICTION[i])
        # For NaN, min(P, max(−P, τ)) would be −P, so after a fault the torque is explicitly set to zero.
        is_trusted = faults[FAULT_CODE] == 0.0
        torque[i] = min(PEAK_TORQUE[i], max(-PEAK_TORQUE[i], force_torque[i] + gravity[i])) if is_trusted else 0.0
    note_command(faults, t, load)
