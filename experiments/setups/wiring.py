"""Where concrete parts are put together: from a configuration to a servo that runs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.instructions import TRACE_SIZE, Program
from controllers.fields.leading import ARGUMENT, PATH, Leading
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import CompiledMap, HapticMap
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.led import Led
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.river_clips import RiverClips
from controllers.safety.energy_tank import EnergyTank
from controllers.safety.limiter import ForceLimiter
from experiments.compiling import compiled_parts
from experiments.config.run_config import MAP_SUFFIX, STRETCHING, RunConfig
from experiments.files.map_files import load_figure_map
from experiments.setups.balance import balanced
from experiments.setups.budget import energy_tank
from experiments.setups.clips import only
from experiments.setups.expression import expressive_figure, oriented
from experiments.setups.figure_maps import clip_map, figure_legs, packed_legs
from experiments.setups.governor import governed_law
from experiments.setups.hands import UPRIGHT, beginning, hand_remarks, stylus_path, user_arm
from experiments.setups.lead import gait_remark, lap_remark, leading_hand, led_map, s_curve
from experiments.setups.lead import law as lead_law
from experiments.setups.led_balance import balanced_on_ground, led_gains
from experiments.setups.lifted_runs import LIFTED_GAINS, default_pushes, lifted_course, lifted_curve, lifted_rivers
from experiments.setups.modes import Field
from experiments.setups.rests import with_rests
from experiments.setups.session import Session
from experiments.setups.stretch import LIFTED_CARRY, flight_remarks, stretch_grabs
from experiments.setups.stretch import law as stretch_law
from experiments.setups.walls import figure_walls
from models.mocap.clip import Clip
from models.scene import FIGURE
from sim.body.figure import Figure, FigureGains
from sim.compilation.kernel_units import law_units
from sim.devices.simulated import simulated_phantom
from sim.loop.servo import Field as CompiledField
from sim.loop.servo import Servo
from sim.reference.map_derivative import map_derivative
from sim.reference.reference import begin_in_motion, check_reference, make_reference, poses_along
from sim.reference.settling import stood
from sim.users.arm import Arm
from sim.world.phantom_port import PhantomPort, phantom_port, sense_in_motion
from sim.world.plant import make_plant
from sim.world.world import World, phantom_angles

Array = npt.NDArray[np.float64]

MOST_PACE = 1.4  # times the clips' own that passes without a word


def wire(
    config: RunConfig,
    clips: tuple[Clip, ...],
    remarks: tuple[str, ...] = (),
    ready: Callable[[tuple[str, ...]], None] = lambda parts: None,
) -> Session:
    """Put a run together.

    Parameters
    ----------
    config : RunConfig
        What to run.
    clips, remarks
        Of `load_clips`.
    ready : callable
        Called before compiled code is needed, with the names of its parts (see `experiments.compiling`).

    Raises
    ------
    ModelError, ControllerError, SimError
        If a number is out of its interval, the rates do not divide, or the curve leaves the workspace.
    """
    if config.figure_ticks < 1:
        raise ParameterError(
            f"figure_ticks is {config.figure_ticks}; expected 1 or more servo ticks between two updates"
        )
    config.scene.substeps()  # the rates, by which the others are measured
    least = 2 * config.figure_ticks * config.scene.servo_period
    if not least <= config.seconds < np.inf:
        raise ParameterError(f"a run of {config.seconds} s; expected {least:g} s or more, and finite")
    if config.seed < 0:
        raise ParameterError(f"seed is {config.seed}; expected 0 or more")
    for name in ("lap", "radius", "reach", "bump", "river_tube", "rubber_tube", "bunny_width"):
        value = getattr(config, name)
        if not (np.isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} is {value}; expected a positive, finite number")
    if config.bump > 0.5 * config.lap:
        raise ParameterError(f"bump is {config.bump} s; expected at most half a lap, {0.5 * config.lap:g} s")
    if config.governor and config.mode in STRETCHING:
        raise ParameterError(f"a curve that is bent has no governor; leave out --governor, or --mode {config.mode}")
    world = World(config.scene)
    leading = config.mode == "lead"
    curve = s_curve() if leading else Trajectory.circle(config.radius, config.lap)
    for phase in np.linspace(curve.start, curve.end, 64):
        phantom_angles(curve.point(phase))
    rivers, led, course = None, None, curve
    if leading:
        blended, gait = led_map(only(clips), figure_legs(world.figure), TRACE_SIZE + PATH)
        led = lead_law(config, gait)
        remarks += lap_remark(only(clips)) + gait_remark(only(clips).name, blended)
    elif config.map.endswith(MAP_SUFFIX):
        blended, clips = load_figure_map(Path(config.map))
        remarks += (f"the clips are those of the map: {', '.join(blended.names)}",)
        if isinstance(blended, Lifted):
            curve = lifted_curve(blended, config.curve)
            rivers = lifted_rivers(blended, config) if config.mode == "rivers" else None
            course = lifted_course(curve, config)
            if rivers is not None and config.user == "push" and not config.pushes:
                config = replace(config, pushes=default_pushes(blended, config))
    else:
        blended = clip_map(config, clips, curve, world.figure)
    if config.curve and not isinstance(blended, Lifted):
        raise ParameterError("only a lifted map has curves by name; leave out --curve, or give --map a lifted one")
    if config.mode in STRETCHING:
        remarks += flight_remarks(clips)
    if config.mode in STRETCHING and not config.grabs:
        share = LIFTED_CARRY if isinstance(blended, Lifted) else 1.0
        config = replace(config, grabs=stretch_grabs(curve, config.rubber_tube, share))
    parts = _assemble(config, (curve, course), blended, rivers, led, world)
    remarks += hand_remarks(config, curve)
    ready(compiled_parts("figure", parts.compiled, parts.program.ops))
    if isinstance(blended, Cylindrical) and not config.map.endswith(MAP_SUFFIX):
        # Its sway is found with compiled code, when everything has been checked.
        blended = balanced(blended, world.figure, config.lap)
        parts = _assemble(config, (curve, course), blended, rivers, led, world)
    if isinstance(blended, RiverClips):
        blended = with_rests(blended, world.figure)
        parts = _assemble(config, (curve, course), blended, rivers, led, world)
    if isinstance(blended, Led) and led is not None:
        blended = balanced_on_ground(blended, led.gait, world.figure)
        parts = _assemble(config, (curve, course), blended, rivers, led, world)
    haptic_map, field, program, compiled, user, limiter, tank, port = parts
    memory = program.fresh_memory()
    if leading:
        # The path that the figure is on is the one that the field lays.
        compiled = compiled._replace(memory=memory)
    period = config.scene.servo_period * config.figure_ticks
    legs, bends = packed_legs(world.figure), config.mode in STRETCHING
    # Where a curve is bent, a hand may hold the figure in the middle of a flight.
    held = 0.0
    if bends and not isinstance(blended, Led):
        held = curve.duration if isinstance(blended, Lifted) else blended.lap_seconds
    reference = make_reference(world.figure, compiled, period, config.smoothing, config.blend, legs, held)
    # A walk at full speed cannot begin from rest: where clips are played as they are, so does the figure.
    moves = isinstance(blended, Lifted | RiverClips) and not bends
    begin = beginning(curve, np.random.default_rng(config.seed), moves)
    poses = np.empty((1, haptic_map.nq))
    walker = memory[TRACE_SIZE + ARGUMENT :][:7]
    argument = walker[None] if leading else stylus_path(begin.point[None])
    poses_along(compiled.kind, compiled.params, compiled.memory.copy(), argument, poses)
    if bends:
        stood(legs, poses[0])
    orientation, v_H, velocity = UPRIGHT if config.expressive or user.turns else None, None, None
    if moves:
        v_H = begin.velocity
        velocity = map_derivative(haptic_map, argument[0])[:, :3] @ v_H
        begin_in_motion(reference, np.array(begin))
    # Where its orientation matters, the stylus begins as the curve and the first pose have it.
    world.reset(begin.point, poses[0], orientation, v_H, velocity)
    if moves:
        sense_in_motion(port)
    gains = LIFTED_GAINS if bends or isinstance(blended, Lifted) else FigureGains()
    if isinstance(blended, Led):
        gains = led_gains(blended)
    figure = Figure(world.model, world.data, world.figure, FIGURE, gains)
    device = simulated_phantom(port, user)
    servo = Servo(
        plant=make_plant(world),
        device=device,
        field=CompiledField(
            units=law_units(program.ops), ops=program.ops, params=program.params, memory=memory,
            limits=limiter.limits(), limiter=limiter.fresh_memory(), budget=tank.params(), tank=tank.fresh_memory(),
            wrench=np.zeros(6), force=np.zeros(3),
        ),
        reference=reference,
        figure=figure.state,
        figure_ticks=config.figure_ticks,
        argument=walker if leading else device.hand[1:8],
    )  # fmt: skip
    if not isinstance(blended, Led):
        remarks += _pace_remark(curve.duration, blended.lap_seconds)
    return Session(config, clips, remarks, course, field, blended, haptic_map, world, figure, servo)


class _Parts(NamedTuple):
    """What a run is made of, apart from its world."""

    haptic_map: HapticMap
    field: Field
    program: Program
    compiled: CompiledMap
    user: Arm
    limiter: ForceLimiter
    tank: EnergyTank
    port: PhantomPort


def _assemble(
    config: RunConfig,
    curves: tuple[Trajectory, Trajectory],
    blended: ClipMap | Led,
    rivers: RiverBundle | None,
    led: Leading | None,
    world: World,
) -> _Parts:
    """Make the parts of a run and check all its numbers, without a call of what would have to be compiled.

    Of the curves, a hand of its own keeps the pace of the first, and the field leads along the second.
    """
    curve, course = curves
    haptic_map = blended if isinstance(blended, Led) or not config.expressive else expressive_figure(blended)
    grabs, urged = config.grabs, 0.0
    if led is not None:
        field = led
    elif config.mode in STRETCHING:
        field = stretch_law(config, course, grabs, isinstance(blended, Lifted))
    else:
        assert not isinstance(blended, Led)
        field, urged = governed_law(config, course, blended, rivers)
    program = field.program() if led is not None else oriented(field.program(), config, course)
    if config.walls:
        walls = figure_walls(haptic_map, config.wall_stiffness, config.wall_margin, config.joint_speed)
        program = program + walls.program()
    compiled, period = haptic_map.compiled(), config.scene.servo_period
    check_reference(period * config.figure_ticks, config.smoothing, config.blend)
    user = user_arm(config, curve, grabs) if led is None else leading_hand(led)
    limiter = ForceLimiter(period)
    tank = energy_tank(config, course, limiter, grabs, urged)
    port = phantom_port(world.model, world.data, period, config.cutoff)
    return _Parts(haptic_map, field, program, compiled, user, limiter, tank, port)


def _pace_remark(lap: float, clips: float) -> tuple[str, ...]:
    """What is said when a lap plays the clips much faster or slower than they are."""
    if 1.0 / MOST_PACE <= clips / lap <= MOST_PACE:
        return ()
    return (
        f"a lap takes {lap:.1f} s and the clips {clips:.1f} s on average, so they are played {clips / lap:.2g} times "
        f"as fast; --lap {clips:.1f} plays them at their own pace",
    )
