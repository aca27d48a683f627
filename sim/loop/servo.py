"""The servo: one compiled loop over device, force field, limiter, user's hand, haptic map, figure and physics.

Each tick of period T:

1. `sense`: device → hand vector in H; an implausible reading is latched as a fault.
2. `feed_walkers`: a figure that is led follows the hand. `evaluate`: the field's program → wrench, and the hand's
   phase on the curve.
3. `command_force`: the wrench's force, limited by force ceiling, energy tank and slew rate; zero after a fault.
4. `actuate`: motor torques of the device, τ = Jᵀ F + N.
5. Every `figure_ticks` ticks, `follow`: h and its derivatives along the hand's motion, and the control of the body
   that tracks them.
6. `advance`: the physics; on a simulated device the user's hand acts on the stylus.

Device and body are chosen by type when the loop is compiled (`sim.devices.device`, `sim.body.drive`).

The loop touches no Python object and does not hold the GIL. The same loop replays recorded controls: the results of
steps 1–5 and of the user's hand are then taken from the recording, so a run is repeated bit for bit.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.map_feed import Maps, feed_maps, unlinked_maps
from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.walker_feed import Walkers, feed_walkers, fresh_walkers
from controllers.lent import by_pointer
from controllers.safety.command import command_force
from controllers.safety.energy_tank import TANK_ENERGY, EnergyTank, reset_tank
from controllers.safety.faults import FAULT_CODE, FAULT_GAPS, FAULT_VALUE, rearm
from controllers.safety.limiter import ForceLimiter, renew_limiter
from geometry.arrays import Array, IntArray
from sim.body.drive import BodyState, follow, follow_addresses
from sim.compilation.compiled import entry_point
from sim.compilation.kernel_units import law_units, linked_stages, linked_walkers
from sim.devices.device import DeviceState, actuate, advance, link_device, sense
from sim.reference.reference_state import CompiledReference
from sim.world.plant import Plant


class Field(NamedTuple):
    """A compiled field, its limiter and its energy tank: program, parameters, memory, and the last wrench and force.

    `units` are the addresses of its laws' kernels (see `sim.compilation.kernel_units`), empty until they are linked.
    `slots` are the places in `memory` where laws in Python put their wrenches. `maps` are the haptic maps whose values
    are passed to laws (see `controllers.fields.algebra.map_feed`), `walkers` the state of led figures, which laws and
    the map read.
    """

    units: IntArray
    ops: IntArray
    params: Array
    memory: Array
    slots: IntArray
    maps: Maps
    walkers: Walkers
    limits: Array
    limiter: Array
    budget: Array
    tank: Array
    wrench: Array
    force: Array

    def of(self, program: Program) -> "Field":
        """The same limiter and energy tank with another program and fresh memory; compiles its laws if needed."""
        return Field(*_program_parts(program), *self[7:]).linked(program)

    def linked(self, program: Program) -> "Field":
        """The same field with the addresses of its kernels; compiles those that are not in the cache."""
        maps = self.maps._replace(stages=linked_stages(self.maps.stages))
        return self._replace(units=law_units(program), maps=maps, walkers=linked_walkers(self.walkers))


def unlinked_field(program: Program, limiter: ForceLimiter, tank: EnergyTank) -> Field:
    """A field for a new run, without the addresses of its laws, so that nothing need be compiled yet."""
    return Field(
        *_program_parts(program), limits=limiter.limits(), limiter=limiter.fresh_memory(), budget=tank.params(),
        tank=tank.fresh_memory(), wrench=np.zeros(6), force=np.zeros(3),
    )  # fmt: skip


def _program_parts(program: Program) -> tuple[IntArray, IntArray, Array, Array, IntArray, Maps, Walkers]:
    """The first seven attributes of a `Field`, those that depend on the program."""
    slots, no_units = [slot for _, slot in program.python_feeds], np.zeros(0, dtype=np.int64)
    memory, maps = program.fresh_memory(), unlinked_maps(program.feeds)
    walkers = fresh_walkers(program.feeds)
    return no_units, program.ops, program.params, memory, np.array(slots, dtype=np.int64), maps, walkers


class Servo(NamedTuple):
    """The whole state of the loop; the figure, or the robot in its place, is updated every `figure_ticks` ticks.

    `argument` (7,) is the pose (position in H, quaternion wxyz) at which the haptic map is evaluated: a view of the
    device's hand vector, or of the `argument` of a walker of the field (`controllers.walking.walker`). `units` (2,) are
    the addresses of the kernels that update the reference and drive the body; they are called by address, so that a
    change in one of them does not recompile the loop.
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
        """The same servo with the addresses of all kernels it calls; compiles those that are not in the cache."""
        link_device(self.device)
        reference = self.reference._replace(stages=linked_stages(self.reference.stages))
        return self._replace(
            units=follow_addresses(self.figure, reference), field=self.field.linked(program),
            reference=reference,
        )  # fmt: skip


class TickLog(NamedTuple):
    """The log of a block of ticks, one row per tick. A replay reads `hand`, `ctrl`, `applied` and `residual` from it.

    Attributes
    ----------
    hand : Array
        The hand vector as measured, shape (n, 15).
    field, force, user : Array
        Wrench of the field (6), force after limiter and tank (3), user's force at the end of the tick (3), in H.
    tank : Array
        Energy in the tank [J], and the share of the force that it let through, shape (n, 2).
    torque : Array
        Torques at the Phantom's joints [N m], shape (n, 3).
    trace : Array
        Phase, closest point, distance (see `controllers.fields.algebra.instructions`), shape (n, 8).
    ctrl : Array
        All motor commands, shape (n, nu).
    applied : Array
        The user's joint torques at each physics step, shape (n, substeps, 3), or (n, substeps, 6) if the hand also
        turns the stylus (see `sim.world.plant.advance`).
    residual : Array
        Residual wrench at the figure's root, shape (n, 6).
    fault : Array
        Code of the device's latched fault, its value, and the number of gaps so far, shape (n, 3).
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
    """The log of a block of figure updates, one row per update.

    Attributes
    ----------
    t : Array
        Time [s], shape (m,).
    qpos : Array
        Configuration of the world, shape (m, nq); for a figure that is only shown, its pose is appended.
    reference : Array
        The reference pose, shape (m, 75); no columns where there is no figure.
    report : Array
        Report of the body's control, shape (m, 10) (see `sim.body.figure_state.REPORT_SUPPORT`), of a robot (m, 8).
    ground : Array
        Ground reaction force on the figure [N], in W, shape (m, 3).
    """

    t: Array
    qpos: Array
    reference: Array
    report: Array
    ground: Array


@njit
def field_force(servo: Servo) -> None:
    """Evaluate the field at the measured hand, and command its force within the safety limits."""
    field, device = servo.field, servo.device
    feed_maps(field.maps, field.params, field.memory, device.hand)
    feed_walkers(field.walkers, field.params, field.memory, device.hand)
    evaluate(field.units, field.ops, field.params, field.memory, device.hand, field.wrench)
    command_force(
        field.limits, field.limiter, field.budget, field.tank, device.faults, device.hand, field.wrench, field.force
    )
    actuate(device, field.force)


@njit
def _run_ticks(servo: Servo, first: int, n: int, replay: bool, ticks: TickLog, frames: FrameLog) -> None:
    """`run_block` on a lent servo and lent logs (`controllers.lent`)."""
    plant, device, every, trace = servo.plant, servo.device, servo.figure_ticks, servo.field.memory[:TRACE_SIZE]
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
                follow(servo.units, servo.figure, servo.reference, servo.argument, trace)
            ticks.hand[k] = device.hand
            ticks.field[k] = servo.field.wrench
            ticks.force[k] = servo.field.force
            ticks.tank[k] = servo.field.tank[TANK_ENERGY : TANK_ENERGY + 2]
            ticks.torque[k] = device.torque
            ticks.trace[k] = trace
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
        All its state is updated.
    first, n : int
        Number of the first tick, a multiple of `figure_ticks` unless n = 1, and the number of ticks to run.
    replay : bool
        Take `hand`, `ctrl`, `applied` and `residual` from `ticks` instead of computing them.
    ticks, frames : TickLog, FrameLog
        Written (or read, see `replay`) row by row.
    """
    _run_ticks(by_pointer(servo), first, n, replay, by_pointer(ticks), by_pointer(frames))


def rearm_servo(servo: Servo) -> None:
    """Clear a latched fault; only ever called explicitly. The force is ramped in from zero from the next tick on.

    State of limiter or energy tank that became invalid is set to the worst case: hot motors, an empty tank.
    """
    rearm(servo.device.faults)
    renew_limiter(servo.field.limits, servo.field.limiter)
    reset_tank(servo.field.tank)
