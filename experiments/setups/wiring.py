"""Wiring: from a configuration to a linked servo with stylus and body in their start state (`wire`)."""

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numba import typeof, types

from controllers.errors import ParameterError
from controllers.safety.limiter import ForceLimiter
from controllers.state import STYLUS_POSE, UPRIGHT
from controllers.walking.walker import walker_at
from experiments.config.run_config import LEAD_WITHOUT_FIGURE, RunConfig, phantom_of
from experiments.fitting.figure_legs import packed_legs
from experiments.setups.parts.bodies import body_of, figure_period
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.devices import DeviceOf, device_of
from experiments.setups.parts.eyes import N_POSES, with_eyes
from experiments.setups.parts.hands import Beginning, beginning
from experiments.setups.parts.lap import lap_remarks
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import MapParts, Parts, Settings
from experiments.setups.session import Session
from experiments.setups.setups import map_parts, parts_of
from geometry.vectors import Quaternion
from models.humanoid.skeleton import rest_pose
from models.mocap.motion.clip import Clip
from models.one_blas_thread import on_one_blas_thread
from sim.body.drive import follow_units
from sim.compilation.kernel_units import units_of_laws, units_of_map
from sim.compilation.units import Unit
from sim.devices.device import device_units, first_reading, measure_in_motion
from sim.devices.simulated import simulated_phantom
from sim.loop.channels import make_logs
from sim.loop.servo import Servo, run_block, unlinked_field
from sim.reference.floor_lowering import lower_start, lower_start_unit
from sim.reference.reference import (
    along_unit,
    begin_in_motion,
    check_reference,
    derivatives_unit,
    map_derivatives,
    poses_unit,
    reference_poses,
)
from sim.world.phantom_port import phantom_port
from sim.world.plant import make_plant
from sim.world.world import World

Ready = Callable[[tuple[Unit, ...]], None]
"""Called before compiled code is needed, with its units (see `experiments.console.compiling`)."""

MapsOf = Callable[[RunConfig, mujoco.MjModel, tuple[Clip, ...] | None], MapParts[Any]]
"""Maps configuration, figure and clips to the map's parts."""


@on_one_blas_thread
def wire(
    config: RunConfig,
    clips: tuple[Clip, ...] | None = None,
    ready: Ready = lambda units: None,
    device: DeviceOf | None = None,
    maps_of: MapsOf = map_parts,
) -> Session:
    """Wire a run from its configuration.

    Parameters
    ----------
    config : RunConfig
        Configuration of the run.
    clips : tuple of Clip, optional
        Clips to use in place of those that the configuration names.
    ready : callable
        See `Ready`.
    device : callable, optional
        See `DeviceOf`; by default that of the configuration.
    maps_of : callable
        Makes the map's parts, as `map_parts` does; many runs on one map may share them.

    Raises
    ------
    HvfError
        If a number is out of its interval, the rates do not divide, or the curve leaves the workspace.
    """
    given, config = config, resolved(config)
    check_seconds(config, config.seconds)
    check_rates(config)
    world = World(config.scene, config.body)
    if device is None and config.leads and not world.has_figure:
        raise ParameterError(LEAD_WITHOUT_FIGURE)  # with a real device, the walker is led even without a figure
    if device is None:
        device = device_of(config, world, config.seconds)
    maps = maps_of(config, world.body, clips).with_remarks(lap_remarks(given.map, config.map, config.seconds))
    return wire_parts(world, maps, lambda maps: parts_of(config, maps), ready, device)


def wire_parts(
    world: World, maps: MapParts[Any], parts_of: Callable[[Any], Parts], ready: Ready, device: DeviceOf | None
) -> Session:
    """Wire a run from a world and the map's parts.

    Parameters
    ----------
    world : World
        The world that is stepped.
    maps : MapParts
        The map's parts.
    parts_of : callable
        Makes the run's parts from the map's parts; called again when the map has been refined.
    ready : callable
        See `Ready`.
    device : callable, optional
        See `DeviceOf`.

    Raises
    ------
    HvfError
        As `wire`.
    """
    draft = parts_of(maps)
    for curve in draft.program.curves:
        check_reach(curve)
    ready(_required_units(draft, _make_servo(draft, world, device)))
    # The map is refined, which takes compiled code, only after all checks have passed and if anything follows it.
    refined = maps if world.kind == "none" else maps.refine(world.kind == "physical")
    parts = draft if refined is maps else parts_of(refined)
    servo = _make_servo(parts, world, device).linked(parts.program)
    if parts.user.wishes is not None and world.has_figure and parts.walking is None:
        phases = np.linspace(parts.maps.curve.start, parts.maps.curve.end, N_POSES, endpoint=False)
        servo = with_eyes(servo, parts.user.wishes, parts.maps.curve.point(phases))
    _set_start_state(parts, servo, world)
    return Session(parts, world, servo, parts.maps.remarks + parts.remarks)


def check_rates(settings: Settings) -> None:
    """Check that the rates divide and that the reference can be filtered at them.

    Raises
    ------
    ModelError, SimError
        If not.
    """
    settings.scene.substeps()
    figure = settings.figure
    check_reference(figure_period(settings), figure.smoothing, figure.blend)


def check_seconds(settings: Settings, seconds: float) -> None:
    """Check that a run of `seconds` has two updates of the figure or more, and an end.

    Raises
    ------
    ParameterError
        If not.
    """
    least = 2.0 * figure_period(settings)
    if not least <= seconds < math.inf:
        raise ParameterError(f"a run of {seconds} s; expected {least:g} s or more, and finite")


def _required_units(parts: Parts, servo: Servo) -> tuple[Unit, ...]:
    """Compilation units of a run: loop over a servo, which need not be linked, with its kernels, start and end."""
    ticks, frames = make_logs(servo, servo.figure_ticks)
    loop = (typeof(servo), types.int64, types.int64, types.boolean, typeof(ticks), typeof(frames))
    units = [
        Unit.of(run_block, *loop),
        *device_units(servo.device),
        *follow_units(servo.figure, servo.reference),
        *units_of_map(np.concatenate([servo.reference.stages, servo.field.maps.stages])),
        *units_of_laws(parts.program),
        poses_unit(),
    ]
    units += [derivatives_unit()] * parts.begins_in_motion
    units += [lower_start_unit()] * (parts.bends and parts.config.body != "robot")
    return (*units, *([along_unit(servo.reference)] * parts.maps.plays_rivers))


def _make_servo(parts: Parts, world: World, device_of: DeviceOf | None) -> Servo:
    """The servo of a run, not yet linked to the addresses of its kernels, so that nothing need be compiled."""
    config, program = parts.config, parts.program
    compiled, walker = parts.maps.whole_map.compiled(), None
    period = config.clock.servo_period
    field = unlinked_field(program, ForceLimiter(period), parts.tank)
    if parts.walking is not None:
        # The field and the map both read the walker: the map poses the figure on its path.
        walker = walker_at.py_func(field.walkers.state, 0)
        compiled = compiled._replace(memory=walker.path)
    if device_of is None:
        step = config.clock.physics_step
        port = phantom_port(world.model, world.data, period, phantom_of(config.device).cutoff)
        device = simulated_phantom(port, parts.user.holding(period, step))
    else:
        device = device_of(world)
    body, reference = body_of(parts, world, compiled)
    return Servo(
        plant=make_plant(world), device=device, field=field, reference=reference, figure=body,
        figure_ticks=config.figure.figure_ticks,
        argument=device.hand[STYLUS_POSE] if walker is None else walker.argument,
    )  # fmt: skip


def _set_start_state(parts: Parts, servo: Servo, world: World) -> None:
    """Set stylus and body to the start state of the run."""
    moves, reference, whole_map = parts.begins_in_motion, servo.reference, parts.maps.whole_map
    start, orientation = _start_state(parts, servo)
    stylus_velocity = start.velocity if moves else None
    if world.kind == "none":
        world.reset(start.point, rest_pose(), orientation, stylus_velocity)
    else:
        stylus_pose = np.concatenate([start.point, UPRIGHT if orientation is None else orientation])
        argument = (stylus_pose if parts.walking is None else servo.argument)[None]
        poses = reference_poses(reference, argument)
        if parts.bends and world.has_figure:
            lower_start(packed_legs(world.body), poses[0], parts.maps.size)
        figure_velocity = map_derivatives(whole_map, argument)[0, :, :3] @ start.velocity if moves else None
        world.reset(start.point, poses[0], orientation, stylus_velocity, figure_velocity)
        if moves:
            begin_in_motion(reference, np.array(start))
    if moves:
        measure_in_motion(servo.device)


def _start_state(parts: Parts, servo: Servo) -> tuple[Beginning, Quaternion | None]:
    """Start state of the stylus, and its orientation; if that is None, the gimbal's joints are at zero."""
    hand = first_reading(servo.device)
    if hand is not None:
        w, x, y, z = (float(number) for number in hand.q)
        return Beginning(hand.p, hand.v, np.zeros(3)), (w, x, y, z)
    begin = beginning(parts.maps.curve, np.random.default_rng(parts.config.seed), parts.begins_in_motion)
    # Where the stylus's orientation matters, it begins upright, as the first pose assumes.
    return begin, UPRIGHT if parts.maps.oriented or parts.user.turns else None
