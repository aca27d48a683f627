"""A person on a Phantom without a field: its motors only compensate its weight, or apply given pushes."""

from typing import NamedTuple

import numpy as np

from controllers.safety.faults import FAULT_CODE, FAULT_TIME, FAULT_VALUE, Fault
from geometry.arrays import Array
from models.humanoid.skeleton import rest_pose
from models.world.scene import SceneConfig
from sim.compilation.compiled import entry_point
from sim.devices.device import user_torques
from sim.devices.simulated import (
    SimulatedPhantom,
    actuate_simulated,
    advance_simulated,
    sense_simulated,
    simulated_phantom,
)
from sim.errors import SimError
from sim.users.participant import Participant
from sim.users.person.person import Person
from sim.users.person.wishes import Wishes
from sim.world.phantom_port import phantom_port
from sim.world.plant import Plant, make_plant
from sim.world.world import World

PERIOD, STEP, CUTOFF = 1e-3, 5e-4, 150.0  # [s], [s], [Hz]
SETTLING_TIME = 0.1  # [s] recorded after the last click, in which the movement comes to rest


class Trace(NamedTuple):
    """Recording of a trial, tick by tick.

    Attributes
    ----------
    t : Array
        Time [s], shape (n,).
    p, v, force : Array
        True position [m] and velocity [m/s] of the stylus and force of the hand [N], in H, shape (n, 3).
    clicks : Array
        Times at which the switch was pressed [s].
    """

    t: Array
    p: Array
    v: Array
    force: Array
    clicks: Array


class End(NamedTuple):
    """What ends a trial before its time.

    Attributes
    ----------
    clicks : int
        It ends `SETTLING_TIME` after so many clicks; -1 for none.
    slip : float
        It ends when the stylus is farther than this from the origin of H [m]: the hand has given way.
    slips_from : float
        Time from which that counts [s].
    """

    clicks: int = -1
    slip: float = np.inf
    slips_from: float = 0.0


_AT_ITS_TIME = End()


@entry_point
def run_bare(device: SimulatedPhantom, plant: Plant, pushes: Array, applied: Array, rows: Array, end: End) -> int:
    """Let the device push a person with a force per tick (n, 3) [N], and write the state of the stylus, shape (n, 10).

    Returns the number of ticks written: fewer than n if the trial ended early.
    """
    pressed, last = 0, rows.shape[0]
    for k in range(rows.shape[0]):
        if k >= last:
            return last
        t = k * plant.period
        sense_simulated(device, t)
        actuate_simulated(device, pushes[k])
        advance_simulated(device, plant, t, False, applied)
        rows[k, 0:3], rows[k, 3:6], rows[k, 6:9] = device.user.p, device.user.v, device.user.force
        rows[k, 9] = device.user.arm.switch[0]
        if t >= end.slips_from and np.sqrt(np.sum(rows[k, 0:3] ** 2)) > end.slip:
            return k + 1
        if rows[k, 9] > 0.0:
            pressed += 1
            if pressed == end.clicks:
                last = min(last, k + 1 + round(SETTLING_TIME / plant.period))
    return last


def trial(
    person: Person, wishes: Wishes, seconds: float, seed: int, start: Array, pushes: Array | None = None,
    end: End = _AT_ITS_TIME,
) -> Trace:  # fmt: skip
    """Trial of a person with given wishes for `seconds` [s], from a start in H [m]; `pushes` (n, 3) of the device [N].

    Raises
    ------
    SimError
        If the device has switched its motors off in the trial.
    """
    world = World(SceneConfig(servo_period=PERIOD, physics_step=STEP), "none")
    world.reset(start, rest_pose())
    port = phantom_port(world.model, world.data, PERIOD, CUTOFF)
    device = simulated_phantom(port, Participant(person, wishes, seed).holding(PERIOD, STEP))
    device.link()
    n = round(seconds / PERIOD)
    rows, plant = np.zeros((n, 10)), make_plant(world)
    given = np.zeros((n, 3)) if pushes is None else pushes
    rows = rows[: run_bare(device, plant, given, np.zeros((plant.substeps, user_torques(device))), rows, end)]
    if fault := Fault(int(device.faults[FAULT_CODE])):
        reason = fault.words(float(device.faults[FAULT_VALUE]))
        raise SimError(f"the device let go of a person after {device.faults[FAULT_TIME]:.3f} s of a trial: {reason}")
    t: Array = PERIOD * np.arange(1, len(rows) + 1, dtype=np.float64)
    return Trace(t, rows[:, 0:3], rows[:, 3:6], rows[:, 6:9], t[rows[:, 9] > 0.0])
