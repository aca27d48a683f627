"""Snapshots of a running servo: its whole state saved and restored, so that a run continues bit for bit."""

from collections.abc import Iterator
from typing import Any, NamedTuple, cast

import mujoco
import numpy as np
import numpy.typing as npt

from sim.loop.servo import Servo
from sim.world.world import World

Array = npt.NDArray[Any]

_CONSTANT_FIELDS = {"params", "ops", "units", "maps", "feeds", "slots", "limits", "budget"}
"""Fields of a servo's parts that are constant during a run."""


class Snapshot(NamedTuple):
    """Number of the next tick, and copies of the MjData and of the `state_arrays` before it."""

    tick: int
    data: mujoco.MjData
    arrays: tuple[Array, ...]


def state_arrays(part: object) -> Iterator[Array]:
    """All arrays of a servo, or of a part of one, that a run changes, in a fixed order."""
    if not isinstance(part, tuple):
        return
    names = getattr(part, "_fields", ("",) * len(cast(tuple[object, ...], part)))
    for name, value in zip(names, cast(tuple[object, ...], part), strict=True):
        if name in _CONSTANT_FIELDS:
            continue
        if isinstance(value, np.ndarray):
            yield cast(Array, value)
        else:
            yield from state_arrays(value)


def take_snapshot(servo: Servo, world: World, tick: int) -> Snapshot:
    """Save the state before tick number `tick`."""
    data = mujoco.MjData(world.model)
    mujoco.mj_copyData(data, world.model, world.data)
    return Snapshot(tick, data, tuple(array.copy() for array in state_arrays(servo)))


def restore_snapshot(servo: Servo, world: World, state: Snapshot) -> None:
    """Restore a saved state of servo and world."""
    for array, saved in zip(state_arrays(servo), state.arrays, strict=True):
        array[...] = saved
    mujoco.mj_copyData(world.data, world.model, state.data)
