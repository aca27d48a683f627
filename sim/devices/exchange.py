"""A device behind two arrays: a driver writes readings into one and takes commands from the other.

This is the seam for hardware: the loop knows the arrays, not what is behind them. The driver, in Python or C, writes
`reading` before each tick, raises its sequence number last, and applies the torques of `command` for as long as
`valid_torque` allows. Angles and torques are the Phantom's joints': kinematics, velocity filter, weight and peak torque
are the simulated device's own.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.safety.faults import FAULT_CODE, HELD, elapsed, judge_reading
from controllers.state import HAND_QUATERNION, HAND_SIZE, HAND_TIME, Array
from sim.errors import SimError
from sim.world.encoders import MEMORY_SIZE, SILENT_PERIODS, motor_torques, plausibility, take_reading
from sim.world.phantom_port import velocity_smoothing
from sim.world.plant import Plant, step
from sim.world.shown_phantom import ShownPhantom, show_angles, shown_phantom
from sim.world.world import World

READING_SEQUENCE, READING_CLOCK, READING_SWITCH, READING_THETA, READING_GIMBAL, READING_SIZE = 0, 1, 2, 3, 6, 9
"""Number of the reading (from 1 on), the driver's clock [s], 1 while the switch is pressed, θ1…θ3 and gimbal [rad]."""
COMMAND_SEQUENCE, COMMAND_CLOCK, COMMAND_TORQUE, COMMAND_FORCE, COMMAND_FAULT, COMMAND_SIZE = 0, 1, 2, 5, 8, 9
"""Number and clock of the reading that is answered, joint torques [N m], force in H [N], code of the fault or 0."""


class Exchange(NamedTuple):
    """A device behind two arrays, as the loop holds it.

    Attributes
    ----------
    reading, command : Array
        Shared with the driver (see `READING_SEQUENCE`, `COMMAND_SEQUENCE`), shapes (9,) and (9,).
    smoothing, silence : float
        The velocity filter's share of the old, and how long a command is valid [s].
    memory : Array
        Of `sim.world.encoders.take_reading`.
    gimbal : Array
        Last gimbal angles taken [rad], shape (3,).
    shown : ShownPhantom
        The world's linkage, which goes where the device is.
    hand, torque, faults, force : Array
        As of every device; who holds it is not known, so the force is zero.
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

    @property
    def user_torques(self) -> int:
        """Columns of zeros where a simulated hand's torques are recorded."""
        return 3


def exchange(
    world: World,
    cutoff: float,
    reading: Array | None = None,
    command: Array | None = None,
    silent: float = SILENT_PERIODS,
) -> Exchange:
    """A device behind two arrays, which begins with no force and ramps it in.

    Parameters
    ----------
    world : World
        Must outlive the device. Its figure follows the hand.
    cutoff : float
        Corner frequency of the velocity filter [Hz].
    reading, command : Array, optional
        Memory to share, such as a view of a mapped file; by default new arrays.
    silent : float
        Periods without a reading or a command after which the device lets go.

    Raises
    ------
    SimError
        If the cutoff is not positive and finite, or an array is not (9,) of float64.
    """
    reading = np.zeros(READING_SIZE) if reading is None else reading
    command = np.zeros(COMMAND_SIZE) if command is None else command
    for name, array, size in (("reading", reading, READING_SIZE), ("command", command, COMMAND_SIZE)):
        if array.shape != (size,) or array.dtype != np.float64 or not array.flags.c_contiguous:
            raise SimError(f"the {name} is {array.dtype} of shape {array.shape}; expected ({size},) of float64")
    period = world.config.servo_period
    limits, hand = plausibility(period, silent), np.zeros(HAND_SIZE)
    hand[HAND_QUATERNION] = 1.0
    return Exchange(
        reading, command, velocity_smoothing(cutoff, period), limits.silence, np.zeros(MEMORY_SIZE), np.zeros(3),
        shown_phantom(world.model, world.data), hand, np.zeros(3), limits.fresh(ramp=0.0), np.zeros(3),
    )  # fmt: skip


@njit
def sense_exchange(device: Exchange, t: float) -> None:
    """Take the driver's reading, if it is a new one and one that can be."""
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
    """Leave the command for the driver, its number last."""
    c, r = device.command, device.reading
    motor_torques(device.faults, device.memory, device.hand[HAND_TIME], force, device.torque)
    for i in range(3):
        c[COMMAND_TORQUE + i] = device.torque[i]
        c[COMMAND_FORCE + i] = force[i]
    c[COMMAND_FAULT] = device.faults[FAULT_CODE]
    c[COMMAND_CLOCK], c[COMMAND_SEQUENCE] = r[READING_CLOCK], r[READING_SEQUENCE]


@njit
def advance_exchange(device: Exchange, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Show the linkage where the device is, and step the physics of the figure."""
    m, g = device.memory, device.gimbal
    if not replay:
        applied[:] = 0.0
    show_angles(device.shown, (m[0], m[1], m[2]), (g[0], g[1], g[2]))
    step(plant)


@njit
def valid_torque(command: Array, silence: float, now: float, torque: Array) -> bool:
    """What a driver applies at its time `now` [s]: the commanded torque; none when that is too old, or after a fault.

    Parameters
    ----------
    command, silence
        Of the `Exchange`.
    now : float
        By the clock that the driver's readings carry [s].
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
