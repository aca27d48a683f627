"""A device as two shared arrays: a driver writes readings into one and takes commands from the other.

This is the hardware interface: the loop knows only the arrays. The driver, in Python or C, writes `reading` before each
tick, its sequence number last, and applies the torques of `command` for as long as `valid_torque` allows. Angles and
torques are those of the Phantom's joints; kinematics, velocity filter, gravity compensation and peak torque are the
same as for the simulated device.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.safety.faults import FAULT_CODE, HELD, elapsed, judge_reading
from controllers.state import HAND_QUATERNION, HAND_SIZE, HAND_TIME
from geometry.arrays import Array
from sim.world.encoders import ANGLES, MEMORY_SIZE, SILENT_PERIODS, motor_torques, plausibility, take_reading
from sim.world.phantom_port import velocity_smoothing
from sim.world.plant import Plant, step
from sim.world.shown_phantom import ShownPhantom, show_angles, shown_phantom
from sim.world.world import World

READING_SEQUENCE, READING_CLOCK, READING_SWITCH, READING_THETA, READING_GIMBAL, READING_SIZE = 0, 1, 2, 3, 6, 9
"""Places in a reading: its number (from 1 on), the driver's clock [s], 1 while the switch is pressed, θ1…θ3 and the
gimbal's three angles [rad]."""
COMMAND_SEQUENCE, COMMAND_CLOCK, COMMAND_TORQUE, COMMAND_FORCE, COMMAND_FAULT, COMMAND_SIZE = 0, 1, 2, 5, 8, 9
"""Places in a command: number and clock of the reading that it answers, joint torques [N m], force in H [N], code of
the latched fault or 0."""


class Exchange(NamedTuple):
    """A device as two shared arrays, with the state that the loop keeps for it.

    Attributes
    ----------
    reading, command : Array
        Shared with the driver (see `READING_SEQUENCE`, `COMMAND_SEQUENCE`), shapes (9,) and (9,).
    smoothing, silence : float
        Share of the old value that the velocity filter keeps, and how long a command is valid [s].
    memory : Array
        State of `sim.world.encoders.take_reading`.
    gimbal : Array
        Last valid gimbal angles [rad], shape (3,).
    shown : ShownPhantom
        The linkage in the world, which is shown in the device's configuration.
    hand, torque, faults, force : Array
        As for every device; the user's force is not known, so it is zero.
    """

    reading: Array
    command: Array
    smoothing: float
    silence: float
    memory: Array
    gimbal: Array
    shown: ShownPhantom
    hand: Array
    torque: Array
    faults: Array
    force: Array


def exchange(world: World, cutoff: float, silent: float = SILENT_PERIODS) -> Exchange:
    """A device as two shared arrays; its force is ramped in from zero.

    Parameters
    ----------
    world : World
        Must outlive the device. Its figure follows the hand.
    cutoff : float
        Corner frequency of the velocity filter [Hz].
    silent : float
        Servo periods without a reading or a command after which the motors are switched off.

    Raises
    ------
    SimError
        If the cutoff is not positive and finite.
    """
    period = world.config.servo_period
    limits, hand = plausibility(period, silent), np.zeros(HAND_SIZE)
    hand[HAND_QUATERNION] = 1.0
    return Exchange(
        np.zeros(READING_SIZE), np.zeros(COMMAND_SIZE), velocity_smoothing(cutoff, period), limits.silence,
        np.zeros(MEMORY_SIZE), np.zeros(3), shown_phantom(world.model, world.data), hand, np.zeros(3),
        limits.fresh(ramp=0.0), np.zeros(3),
    )  # fmt: skip


@njit
def sense_exchange(device: Exchange, t: float) -> None:
    """Take the driver's reading if it is new and plausible."""
    r = device.reading
    theta = (r[READING_THETA], r[READING_THETA + 1], r[READING_THETA + 2])
    gimbal = (r[READING_GIMBAL], r[READING_GIMBAL + 1], r[READING_GIMBAL + 2])
    verdict = judge_reading(
        device.faults, theta, gimbal, device.memory, t, r[READING_CLOCK], r[READING_SEQUENCE], False
    )
    if verdict == HELD:
        device.hand[HAND_TIME] = t
    else:
        for i in range(3):
            device.gimbal[i] = gimbal[i]
        period = elapsed(device.faults)
        take_reading(device.hand, device.memory, device.smoothing, period, theta, gimbal, t, r[READING_SWITCH], verdict)


@njit
def actuate_exchange(device: Exchange, force: Array) -> None:
    """Write the command for the driver, its number last."""
    c, r = device.command, device.reading
    motor_torques(device.faults, device.memory, device.hand[HAND_TIME], force, device.torque)
    for i in range(3):
        c[COMMAND_TORQUE + i] = device.torque[i]
        c[COMMAND_FORCE + i] = force[i]
    c[COMMAND_FAULT] = device.faults[FAULT_CODE]
    c[COMMAND_CLOCK], c[COMMAND_SEQUENCE] = r[READING_CLOCK], r[READING_SEQUENCE]


@njit
def advance_exchange(device: Exchange, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Show the linkage in the device's configuration, and step the physics of the figure."""
    theta, g = device.memory[ANGLES : ANGLES + 3], device.gimbal
    if not replay:
        applied[:] = 0.0
    show_angles(device.shown, (theta[0], theta[1], theta[2]), (g[0], g[1], g[2]))
    step(plant)


@njit
def valid_torque(command: Array, silence: float, now: float, torque: Array) -> bool:
    """Write the torque that a driver must apply at time `now`: the commanded one, or zero if too old or after a fault.

    Parameters
    ----------
    command, silence
        Those of the `Exchange`.
    now : float
        Time by the clock that timestamps the driver's readings [s].
    torque : Array
        Written [N m], shape (3,).

    Returns
    -------
    bool
        Whether the command is valid.
    """
    valid = command[COMMAND_FAULT] == 0.0 and now - command[COMMAND_CLOCK] <= silence
    for i in range(3):
        torque[i] = command[COMMAND_TORQUE + i] if valid else 0.0
    return valid
