"""A recorded hand as a device: it repeats its recorded motion whatever force is commanded."""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.safety.faults import READING_NOT_FINITE, READINGS_ENDED, first_not_finite, latch
from controllers.state import HAND_POSITION, HAND_QUATERNION, HAND_SIZE, HAND_TIME, HAND_VELOCITY
from geometry.arrays import Array
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.world.encoders import plausibility
from sim.world.plant import Plant, step
from sim.world.shown_phantom import ShownPhantom, show_hand, shown_phantom
from sim.world.world import World

_CHANNELS = ("t", "p", "quaternion", "v", "omega", "switch")


class ReplayedHand(NamedTuple):
    """A recorded hand as a device; force and torque are always zero, since it has no motors and no user.

    Attributes
    ----------
    rows : Array
        Hand vectors, one per tick, shape (n, 15).
    period : float
        Time between two rows, the servo period [s].
    shown : ShownPhantom
        The linkage in the world, which is shown where the hand was.
    hand, torque, faults, force : Array
        As for every device.
    """

    rows: Array
    period: float
    shown: ShownPhantom
    hand: Array
    torque: Array
    faults: Array
    force: Array


def recorded_hand(recording: Recording) -> Array:
    """Hand vectors of a recording, shape (n, 15).

    Raises
    ------
    SimError
        If it holds no tick.
    """
    columns = [recording.channel("ticks", name)[:] for name in _CHANNELS]
    return np.concatenate([column.reshape(len(column), -1) for column in columns], axis=1)


def replayed_hand(rows: Array, world: World, period: float | None = None) -> ReplayedHand:
    """The device of a recorded hand in a world.

    Parameters
    ----------
    rows : Array
        Hand vectors one servo period apart, shape (n, 15), such as `recorded_hand` gives.
    world : World
        Must outlive the device. Its figure follows the hand.
    period : float, optional
        Period at which the hand was recorded [s]; by default the world's servo period.

    Raises
    ------
    SimError
        If there are no rows, they are not hand vectors of finite numbers, or `period` is not the servo period.
    """
    servo_period = world.config.servo_period
    if rows.ndim != 2 or rows.shape[1] != HAND_SIZE or len(rows) == 0:
        raise SimError(f"a recorded hand has shape {rows.shape}; expected (n, {HAND_SIZE}) with n ≥ 1")
    if not np.all(np.isfinite(rows)):
        raise SimError(f"the recorded hand is not finite in row {int(np.argmin(np.isfinite(rows).all(axis=1)))}")
    if period is not None and abs(period - servo_period) > 1e-9:
        raise SimError(
            f"the hand was recorded every {period:g} s, the servo runs every {servo_period:g} s; expected the same"
        )
    hand = np.zeros(HAND_SIZE)
    hand[HAND_QUATERNION] = 1.0
    return ReplayedHand(
        np.ascontiguousarray(rows), servo_period, shown_phantom(world.model, world.data), hand, np.zeros(3),
        plausibility(servo_period).fresh(), np.zeros(3),
    )  # fmt: skip


@njit
def sense_replayed(device: ReplayedHand, t: float) -> None:
    """Take the row of time t; past the last row, or if it is not finite, latch a fault and keep the last hand."""
    hand, tick = device.hand, round(t / device.period)
    if tick >= device.rows.shape[0]:
        latch(device.faults, READINGS_ENDED, t, device.rows.shape[0])
    elif not np.isfinite(np.sum(device.rows[tick])):
        latch(device.faults, READING_NOT_FINITE, t, first_not_finite(device.rows[tick]))
    else:
        hand[:] = device.rows[tick]
    hand[HAND_TIME] = t


@njit
def actuate_replayed(device: ReplayedHand, force: Array) -> None:
    """Do nothing: a recorded hand is not moved by a force."""


@njit
def advance_replayed(device: ReplayedHand, plant: Plant, t: float, replay: bool, applied: Array) -> None:
    """Show the linkage where the hand was, and step the physics."""
    hand = device.hand
    if not replay:
        applied[:] = 0.0
    show_hand(device.shown, hand[HAND_POSITION:HAND_QUATERNION], hand[HAND_QUATERNION:HAND_VELOCITY])
    step(plant)
