"""The servo: one compiled loop over device, law of force, limiter, hand, haptic map, figure and physics.

Each tick of period T:

1. `sense`: encoders → hand vector in H.
2. `evaluate`: the field's program → wrench, and where on the curve the hand is.
3. `limit_force`: what the device may be asked for; `guard_energy`: how much of it the energy tank allows.
4. `actuate`: τ = Jᵀ F + N → the Phantom's motors.
5. Every `figure_ticks` ticks: `update_reference` (h and its derivatives along the hand's motion), and `drive`, which
   sets the torques of the figure that follows it.
6. For each physics step: the hand's force → external torques on the linkage; `mj_step`.

The loop holds no Python object and not the GIL. The same loop replays recorded controls: steps 1–5 and the hand are
then replaced by what they gave, so a run is repeated bit for bit.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.fields.instructions import TRACE_SIZE
from controllers.fields.law import Program
from controllers.fields.map_feed import feed_maps, feed_rows
from controllers.fields.program import evaluate
from controllers.kernel_call import call_as_given
from controllers.safety.energy_tank import TANK_ENERGY, EnergyTank, guard_energy
from controllers.safety.limiter import ForceLimiter, limit_force
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY
from sim.body.drive import BodyState, drive_unit
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import law_units, map_units
from sim.errors import SimError
from sim.reference.reference import update_unit
from sim.reference.reference_state import CompiledReference
from sim.world.phantom_port import PhantomPort, actuate, has_sensed, sense
from sim.world.plant import Hand, Plant, advance

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class Field(NamedTuple):
    """A compiled field, its limiter and its energy tank: programs, parameters, memory, and the last wrench.

    `units` are the addresses of its laws' kernels (see `sim.compilation.kernel_units`), none before they are linked;
    `slots` the places in the memory of what laws in Python give, `maps` what its laws are told of the haptic map (see
    `controllers.fields.map_feed`).
    """

    units: IntArray
    ops: IntArray
    params: Array
    memory: Array
    slots: IntArray
    maps: IntArray
    limits: Array
    limiter: Array
    budget: Array
    tank: Array
    wrench: Array
    force: Array

    def of(self, program: Program) -> "Field":
        """The same limits and budget about another program, with a fresh memory; its laws are compiled if needed."""
        return Field(*_program_parts(program), *self[6:])._replace(units=law_units(program))


def unlinked_field(program: Program, limiter: ForceLimiter, tank: EnergyTank) -> Field:
    """A field for a new run, without the addresses of its laws: nothing has to be compiled for it."""
    return Field(
        *_program_parts(program), limits=limiter.limits(), limiter=limiter.fresh_memory(), budget=tank.params(),
        tank=tank.fresh_memory(), wrench=np.zeros(6), force=np.zeros(3),
    )  # fmt: skip


def _program_parts(program: Program) -> tuple[IntArray, IntArray, Array, Array, IntArray, IntArray]:
    """The first of the attributes of a `Field`."""
    slots, nothing = [feed.slot for feed in program.python_feeds], np.zeros(0, dtype=np.int64)
    memory, maps = program.fresh_memory(), feed_rows(program.map_feeds)
    return nothing, program.ops, program.params, memory, np.array(slots, dtype=np.int64), maps


class Servo(NamedTuple):
    """All that the loop works on; the figure, or the robot in its place, is updated every `figure_ticks` ticks.

    `argument` (7,) is what the haptic map is evaluated at: a view of the port's hand, where the stylus is, or that of
    a `controllers.walking.walker.Walker` that the field moves. `units` (2,) are the addresses of what updates the
    reference and of what drives the body: a change in one of them is not one of the loop.
    """

    plant: Plant
    port: PhantomPort
    field: Field
    hand: Hand
    reference: CompiledReference
    figure: BodyState
    figure_ticks: int
    argument: Array
    units: IntArray = np.zeros(2, dtype=np.int64)

    def linked(self, program: Program) -> "Servo":
        """The same with the addresses of all kernels that it and its field call; compiles what is not kept."""
        field, reference = self.field, self.reference
        return self._replace(
            units=np.array([update_unit(reference).address(), drive_unit(self.figure).address()]),
            field=field._replace(units=law_units(program)),
            reference=reference._replace(units=map_units([(reference.kind, reference.params)])),
        )


class TickLog(NamedTuple):
    """What a block of ticks leaves behind: one row a tick. A replay reads `ctrl`, `applied` and `residual` instead.

    Attributes
    ----------
    hand : Array
        The hand vector as measured, shape (n, 15).
    field, force, user : Array
        Wrench of the field (6), force after limiter and tank (3), force of the hand at the end of the tick (3), in H.
    tank : Array
        Energy [J] that the tank holds, and the share of the force that it let through, shape (n, 2).
    torque : Array
        Torques at the Phantom's joints [N m], shape (n, 3).
    trace : Array
        Phase, closest point, distance (see `controllers.fields.instructions`), shape (n, 8).
    ctrl : Array
        All motor commands, shape (n, nu).
    applied : Array
        The hand's torques at each physics step, shape (n, substeps, 3), or 6 (see `sim.world.plant.advance`).
    residual : Array
        Residual wrench at the figure's root, shape (n, 6).
    """

    hand: Array
    field: Array
    force: Array
    user: Array
    tank: Array
    torque: Array
    trace: Array
    ctrl: Array
    applied: Array
    residual: Array


class FrameLog(NamedTuple):
    """What a block of figure updates leaves behind: one row each.

    Attributes
    ----------
    t : Array
        Time [s], shape (m,).
    qpos : Array
        Configuration of the world, shape (m, nq).
    reference : Array
        The animation's pose, shape (m, 75).
    report : Array
        What the figure's control tells (see `sim.body.figure`), shape (m, 8).
    ground : Array
        Force of the ground on the figure [N], in the world, shape (m, 3).
    """

    t: Array
    qpos: Array
    reference: Array
    report: Array
    ground: Array


@njit(inline="always")  # a call would hand over all of the servo's arrays, number by number
def field_force(servo: Servo) -> None:
    """Evaluate and limit the field at the measured hand, within the tank's budget, and command the motors."""
    field, hand = servo.field, servo.port.hand
    feed_maps(servo.reference.units, field.maps, field.params, field.memory, hand)
    evaluate(field.units, field.ops, field.params, field.memory, hand, field.wrench)
    limit_force(field.limits, field.limiter, field.wrench, field.force)
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    guard_energy(field.budget, field.tank, p, v, field.force)
    actuate(servo.port, field.force)


@njit(inline="always")
def move_figure(servo: Servo) -> None:
    """Update the animation at the map's argument, and the torques that follow it."""
    reference, units = servo.reference, servo.units
    if units[0] == 0 or units[1] == 0:
        raise SimError("what updates and drives the figure is not compiled; take the servo's `linked`")
    call_as_given(units[0], (reference, servo.argument, servo.field.memory[:TRACE_SIZE]))
    call_as_given(units[1], (servo.figure, reference.pose, reference.velocity, reference.acceleration))


@entry_point
def run_block(servo: Servo, first: int, n: int, replay: bool, ticks: TickLog, frames: FrameLog) -> None:
    """Run n ticks from tick number `first`, or replay them.

    Parameters
    ----------
    servo : Servo
        Everything in it is updated.
    first, n : int
        Number of the first tick, a multiple of the figure's ticks, and how many to run; any tick alone may be run.
    replay : bool
        Take `ctrl`, `applied` and `residual` from `ticks` instead of computing them.
    ticks, frames : TickLog, FrameLog
        Written (or read, see `replay`) row by row.
    """
    plant, port, every = servo.plant, servo.port, servo.figure_ticks
    for k in range(n):
        t = (first + k) * plant.period
        update_figure = (first + k) % every == 0
        if replay:
            plant.ctrl[:] = ticks.ctrl[k]
            servo.figure.applied[:] = ticks.residual[k]
        else:
            # A tick whose hand Python has already been told of is not sensed twice.
            if port.hand[HAND_TIME] != t or not has_sensed(port):
                sense(port, t, servo.hand.arm.switch[0])
            field_force(servo)
            if update_figure:
                move_figure(servo)
            ticks.hand[k] = port.hand
            ticks.field[k] = servo.field.wrench
            ticks.force[k] = servo.field.force
            ticks.tank[k] = servo.field.tank[TANK_ENERGY : TANK_ENERGY + 2]
            ticks.torque[k] = port.torque
            ticks.trace[k] = servo.field.memory[:TRACE_SIZE]
            ticks.ctrl[k] = plant.ctrl
            ticks.residual[k] = servo.figure.applied
        if update_figure:
            row = k // every
            frames.t[row] = t
            frames.qpos[row] = plant.qpos
            frames.reference[row] = servo.reference.pose
            frames.report[row] = servo.figure.report
            frames.ground[row] = plant.ground
        advance(plant, port, servo.hand, t, replay, ticks.applied[k])
        ticks.user[k] = servo.hand.force
