"""The servo: one compiled loop over device, law of force, limiter, hand, haptic map, figure and physics.

Each tick of period T:

1. `sense`: the device → hand vector in H; what cannot be a reading is latched as a fault.
2. `evaluate`: the field's program → wrench, and where on the curve the hand is.
3. `command_force`: what of it the device is commanded, within ceiling, energy tank and slew; nothing after a fault.
4. `actuate`: the device's motors, τ = Jᵀ F + N.
5. Every `figure_ticks` ticks: `follow`: h and its derivatives along the hand's motion, and what of a body follows it.
6. `advance`: the world, with the hand's force on a simulated device.

Device and body are chosen by type when the loop is compiled (`sim.devices.device`, `sim.body.drive`).

The loop holds no Python object and not the GIL. The same loop replays recorded controls: steps 1–5 and the hand are
then replaced by what they gave, so a run is repeated bit for bit.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.borrowed import borrowed
from controllers.fields.instructions import TRACE_SIZE
from controllers.fields.law import Program
from controllers.fields.map_feed import feed_maps, feed_rows
from controllers.fields.program import evaluate
from controllers.safety.command import command_force
from controllers.safety.energy_tank import TANK_ENERGY, EnergyTank, renew_tank
from controllers.safety.faults import FAULT_CODE, FAULT_GAPS, FAULT_VALUE, rearm
from controllers.safety.limiter import ForceLimiter, renew_limiter
from controllers.state import Array
from sim.body.drive import BodyState, follow, follow_addresses, lend_followed
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import law_units, map_units
from sim.devices.device import DeviceState, actuate, advance, link_device, sense
from sim.reference.reference import NO_MAP
from sim.reference.reference_state import CompiledReference
from sim.world.plant import Plant

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

    `argument` (7,) is what the haptic map is evaluated at: a view of the device's hand, where the stylus is, or that of
    a `controllers.walking.walker.Walker` that the field moves. `units` (2,) are the addresses of what updates the
    reference and of what drives the body: a change in one of them is not one of the loop.
    """

    plant: Plant
    device: DeviceState
    field: Field
    reference: CompiledReference
    figure: BodyState
    figure_ticks: int
    argument: Array
    units: IntArray = np.zeros(2, dtype=np.int64)

    def linked(self, program: Program) -> "Servo":
        """The same with the addresses of all kernels that it and its field call; compiles what is not kept."""
        link_device(self.device)
        reference = self.reference
        if reference.kind != NO_MAP:
            reference = reference._replace(units=map_units([(reference.kind, reference.params)]))
        return self._replace(
            units=follow_addresses(self.figure, reference), field=self.field._replace(units=law_units(program)),
            reference=reference,
        )  # fmt: skip


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
    fault : Array
        Of the device: code of the fault that is latched, its value, and the number of gaps so far, shape (n, 3).
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
    fault: Array


class FrameLog(NamedTuple):
    """What a block of figure updates leaves behind: one row each.

    Attributes
    ----------
    t : Array
        Time [s], shape (m,).
    qpos : Array
        Configuration of the world, shape (m, nq); of a figure that is not in it the reference pose comes after that.
    reference : Array
        The animation's pose, shape (m, 75); nothing where there is no figure.
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
    """Evaluate the field at the measured hand, and command what of it is safe."""
    field, device = servo.field, servo.device
    feed_maps(servo.reference.units, field.maps, field.params, field.memory, device.hand)
    evaluate(field.units, field.ops, field.params, field.memory, device.hand, field.wrench)
    command_force(
        field.limits, field.limiter, field.budget, field.tank, device.faults, device.hand, field.wrench, field.force
    )
    actuate(device, field.force)


@njit(forceinline=True)
def _run(servo: Servo, first: int, n: int, replay: bool, ticks: TickLog, frames: FrameLog) -> None:
    """`run_block`, over arrays that it borrows."""
    plant, device, every = servo.plant, servo.device, servo.figure_ticks
    followed = lend_followed(servo.figure, servo.reference, servo.argument, servo.field.memory[:TRACE_SIZE])
    for k in range(n):
        t = (first + k) * plant.period
        update_figure = (first + k) % every == 0
        if replay:
            plant.ctrl[:] = ticks.ctrl[k]
            servo.figure.applied[:] = ticks.residual[k]
            device.hand[:] = ticks.hand[k]
        else:
            sense(device, t)
            field_force(servo)
            if update_figure:
                follow(servo.units, servo.figure, followed)
            ticks.hand[k] = device.hand
            ticks.field[k] = servo.field.wrench
            ticks.force[k] = servo.field.force
            ticks.tank[k] = servo.field.tank[TANK_ENERGY : TANK_ENERGY + 2]
            ticks.torque[k] = device.torque
            ticks.trace[k] = servo.field.memory[:TRACE_SIZE]
            ticks.ctrl[k] = plant.ctrl
            ticks.residual[k] = servo.figure.applied
            ticks.fault[k, 0] = device.faults[FAULT_CODE]
            ticks.fault[k, 1] = device.faults[FAULT_VALUE]
            ticks.fault[k, 2] = device.faults[FAULT_GAPS]
        if update_figure:
            row, nq = k // every, plant.qpos.shape[0]
            frames.t[row] = t
            frames.qpos[row, :nq] = plant.qpos
            if frames.qpos.shape[1] > nq:
                frames.qpos[row, nq:] = servo.reference.pose
            frames.reference[row] = servo.reference.pose
            frames.report[row] = servo.figure.report
            frames.ground[row] = plant.ground
        advance(device, plant, t, replay, ticks.applied[k])
        ticks.user[k] = device.force


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
    _run(borrowed(servo), first, n, replay, borrowed(ticks), borrowed(frames))


def rearm_servo(servo: Servo) -> None:
    """Forget a latched fault, on purpose and by name: the force is ramped in from zero, from the next tick on.

    Memory of limiter and energy tank that was lost is taken for the worst: a hot device, an empty tank.
    """
    rearm(servo.device.faults)
    renew_limiter(servo.field.limits, servo.field.limiter)
    renew_tank(servo.field.tank)
