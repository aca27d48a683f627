"""Where concrete parts are put together: from a configuration to a servo that runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.higher_order import HigherOrder
from controllers.fields.instructions import TRACE_SIZE
from controllers.fields.leading import ARGUMENT, PATH, Leading
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.led import Led
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.limbs import Limb
from controllers.haptic_map.river_clips import RiverClips
from controllers.safety import ForceLimiter
from experiments.balance import balanced
from experiments.budget import energy_tank
from experiments.config import STRETCHING, RunConfig
from experiments.expression import expressive_figure, lap_turns, oriented
from experiments.governor import governed_law
from experiments.lead import law as lead_law
from experiments.lead import lead_static, leading_hand, led_map, s_curve, walker_argument
from experiments.lifted_runs import lifted_curve, lifted_rivers
from experiments.map_files import MAP_SUFFIX, load_figure_map
from experiments.modes import Field, default_rivers
from experiments.stretch import law as stretch_law
from experiments.stretch import stretch_grabs
from experiments.walls import figure_walls
from models.errors import ModelError
from models.humanoid.skeleton import BODIES, FOOT_CONTACTS
from models.mocap.clip import Clip
from models.mocap.library import embedded, embedded_names, load
from models.phantom.parameters import PREMIUM_1_5
from models.scene import FIGURE, P_WH
from sim.devices.phantom_port import phantom_port
from sim.figure import Figure
from sim.plant import make_hand, make_plant
from sim.reference import make_reference, poses_along
from sim.servo import Field as CompiledField
from sim.servo import Servo
from sim.users.arm import Arm
from sim.users.intent import Grab, Push
from sim.world import World, phantom_angles

Array = npt.NDArray[np.float64]

PUSH_FORCE = 2.5  # of the hand that pushes twice a lap [N]; the motors can answer that for ever
UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # orientation of the stylus along the default curve
_MOST_CLIPS = {"cylindrical": 4, "composite": 3, "rivers": 3}
MOST_PACE = 1.4  # times the clips' own that passes without a word


@dataclass(frozen=True)
class Session:
    """A run that is wired up and has not begun: the servo, and what it was made of.

    The haptic map is that of the clips, or an expressive map about it.
    """

    config: RunConfig
    clips: tuple[Clip, ...]
    remarks: tuple[str, ...]
    curve: Trajectory
    field: Field
    clip_map: ClipMap | Led
    haptic_map: HapticMap
    world: World
    figure: Figure
    servo: Servo

    def static(self) -> dict[str, npt.ArrayLike | str]:
        """What the recording keeps beside the channels."""
        phases = np.linspace(self.curve.start, self.curve.end, 241)
        return {
            "curve": self.curve.point(phases),
            "curve_span": np.array([self.curve.start, self.curve.end]),
            "curve_closed": float(self.curve.periodic),
            "tube_radius": self.config.reach,
            "p_WH": P_WH,
            "motor_continuous": np.array(PREMIUM_1_5.continuous_torque),
            "motor_peak": np.array(PREMIUM_1_5.peak_torque),
            "body_weight": self.figure.state.weight,
            "clip_names": "\n".join(clip.name for clip in self.clips),
            **{f"clip_{i}": clip.poses for i, clip in enumerate(self.clips)},
            "clip_fps": np.array([clip.fps for clip in self.clips]),
            **(lead_static(self.field) if isinstance(self.field, Leading) else {}),
            **self._rivers(),
        }

    def _rivers(self) -> dict[str, npt.ArrayLike | str]:
        """Names and curves of the rivers of a field that gives the hand to one of them."""
        if not isinstance(self.field, HigherOrder):
            return {}
        bundle, share = self.field.bundle, np.linspace(0.0, 1.0, 241)
        curves = [r.curve.point(r.curve.start + share * r.curve.duration) for r in bundle.rivers]
        return {"river_names": "\n".join(bundle.names), "river_curves": np.array(curves)}


def load_clips(names: Sequence[str]) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """Clips by name or file, and what has to be said about them.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    clips: list[Clip] = []
    remarks: list[str] = []
    for name in names:
        if name in embedded_names():
            clips.append(embedded(name))
        elif not Path(name).suffix:
            raise ModelError(f"no embedded clip {name!r}; there are {', '.join(embedded_names())}, or give a file")
        else:
            loaded = load(Path(name))
            clips.append(loaded.clip)
            remarks += [] if loaded.report is None else loaded.report.lines()
    return tuple(clips), tuple(remarks)


def wire(
    config: RunConfig, clips: tuple[Clip, ...], remarks: tuple[str, ...] = (), ready: Callable[[], None] = lambda: None
) -> Session:
    """Put a run together.

    Parameters
    ----------
    config : RunConfig
        What to run.
    clips, remarks
        Of `load_clips`.
    ready : callable
        Called when everything has been checked and before compiled code is needed.

    Raises
    ------
    ModelError, ControllerError, SimError
        If a number is out of its interval, the rates do not divide, or the curve leaves the workspace.
    """
    if config.figure_ticks < 1:
        raise ParameterError(
            f"figure_ticks is {config.figure_ticks}; expected 1 or more servo ticks between two updates"
        )
    least = 2 * config.figure_ticks * config.scene.servo_period
    if not least <= config.seconds < np.inf:
        raise ParameterError(f"a run of {config.seconds} s; expected {least:g} s or more, and finite")
    for name in ("lap", "radius", "reach", "bump"):
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
    rivers, led = None, None
    if leading:
        blended, gait = led_map(_only(clips), figure_legs(world.figure), TRACE_SIZE + PATH)
        led = lead_law(config, gait)
    elif config.map.endswith(MAP_SUFFIX):
        blended, clips = load_figure_map(Path(config.map))
        remarks += (f"the clips are those of the map: {', '.join(blended.names)}",)
        if isinstance(blended, Lifted):
            curve = lifted_curve(blended, config.curve)
            rivers = lifted_rivers(blended, config) if config.mode == "rivers" else None
    else:
        blended = _haptic_map(config, clips, curve, world.figure)
    if config.curve and not isinstance(blended, Lifted):
        raise ParameterError("only a lifted map has curves by name; leave out --curve, or give --map a lifted one")
    haptic_map = expressive_figure(blended) if config.expressive and not isinstance(blended, Led) else blended
    grabs = config.grabs or (stretch_grabs(curve, config.rubber_tube) if config.mode in STRETCHING else ())
    urged = 0.0
    if led is not None:
        field = led
    elif config.mode in STRETCHING:
        field = stretch_law(config, curve, grabs)
    else:
        assert not isinstance(blended, Led)
        field, urged = governed_law(config, curve, blended, rivers)
    program = field.program() if leading else oriented(field.program(), config, curve)
    if config.walls:
        walls = figure_walls(haptic_map, config.wall_stiffness, config.wall_margin, config.joint_speed)
        program = program + walls.program()
    memory, period = program.fresh_memory(), config.scene.servo_period
    compiled = haptic_map.compiled()
    if leading:
        # The path that the figure is on is the one that the field lays.
        compiled = compiled._replace(memory=memory)
    reference = make_reference(
        world.figure, compiled, period * config.figure_ticks, config.smoothing, config.blend, packed_legs(world.figure)
    )
    start = curve.point(curve.start) + np.random.default_rng(config.seed).normal(scale=1e-3, size=3)
    poses = np.empty((1, haptic_map.nq))
    argument = walker_argument(np.zeros(1)) if leading else stylus_path(start[None])
    user = _user(config, curve, grabs) if led is None else leading_hand(led)
    limiter = ForceLimiter(period)
    tank = energy_tank(config, curve, limiter, grabs, urged)
    port = phantom_port(world.model, world.data, period, config.cutoff)
    ready()
    poses_along(compiled.kind, compiled.params, compiled.memory.copy(), argument, poses)
    # Where its orientation matters, the stylus begins as the curve and the first pose have it.
    world.reset(start, poses[0], UPRIGHT if config.expressive or user.turns else None)
    figure = Figure(world.model, world.data, world.figure, FIGURE)
    servo = Servo(
        plant=make_plant(world),
        port=port,
        field=CompiledField(
            ops=program.ops, params=program.params, memory=memory, limits=limiter.limits(),
            limiter=limiter.fresh_memory(), budget=tank.params(), tank=tank.fresh_memory(),
            wrench=np.zeros(6), force=np.zeros(3),
        ),
        hand=make_hand(user),
        reference=reference,
        figure=figure.state,
        figure_ticks=config.figure_ticks,
        argument=memory[TRACE_SIZE + ARGUMENT :][:7] if leading else port.hand[1:8],
    )  # fmt: skip
    if not isinstance(blended, Led):
        remarks += _pace_remark(curve.duration, blended.lap_seconds)
    return Session(config, clips, remarks, curve, field, blended, haptic_map, world, figure, servo)


def _only(clips: tuple[Clip, ...]) -> Clip:
    if len(clips) != 1:
        raise ParameterError(f"one clip is led, got {len(clips)}; name one with --clips, such as walk or run")
    return clips[0]


def _pace_remark(lap: float, clips: float) -> tuple[str, ...]:
    """What is said when a lap plays the clips much faster or slower than they are."""
    if 1.0 / MOST_PACE <= clips / lap <= MOST_PACE:
        return ()
    return (
        f"a lap takes {lap:.1f} s and the clips {clips:.1f} s on average, so they are played {clips / lap:.2g} times "
        f"as fast; --lap {clips:.1f} plays them at their own pace",
    )


def _haptic_map(config: RunConfig, clips: tuple[Clip, ...], curve: Trajectory, figure: mujoco.MjModel) -> ClipMap:
    if config.map not in _MOST_CLIPS:
        raise ParameterError(f"no map {config.map!r}; there are {', '.join(_MOST_CLIPS)}, or give a file (.npz)")
    most = _MOST_CLIPS[config.map]
    if not 1 <= len(clips) <= most:
        raise ParameterError(f"the {config.map} map takes 1 to {most} clips, got {len(clips)}; name them with --clips")
    motions = [(clip.poses, clip.fps) for clip in clips]
    radii = (config.radius - config.reach, config.radius + config.reach)
    legs = figure_legs(figure)
    if config.map == "cylindrical":
        corners = [motions[i % len(motions)] for i in range(4)]
        return balanced(Cylindrical(corners, radii, (-config.reach, config.reach), legs), figure, config.lap)
    if config.map == "rivers":
        if config.mode != "rivers" or config.crossing == "sum":
            raise ParameterError(
                "the rivers' map needs --mode rivers, and a --crossing that gives the hand to one river"
            )
        curves = [river.curve for river in default_rivers(config, curve).rivers]
        motions = [motions[i % len(motions)] for i in range(len(curves))]
        return RiverClips(curves, motions, config.river_tube, legs)
    lower, red, blue = (motions[i % len(motions)] for i in range(3))
    upper = set(range(1, len(BODIES))).difference(*(leg.joints for leg in legs))
    return Composite(lower, red, blue, sorted(upper), radii, legs)


def figure_legs(figure: mujoco.MjModel) -> tuple[Limb, ...]:
    """The figure's legs as limbs of a blend: soles are placed where they are in the clips on average."""
    legs: list[Limb] = []
    for side in ("left", "right"):
        bodies = [f"{side}_{part}" for part in ("thigh", "shank", "foot")]
        first, second, third = (BODIES.index(body) for body in bodies)
        offsets = np.array([figure.body(body).pos for body in bodies])
        sole = np.array([figure.geom(name).pos for name in FOOT_CONTACTS if name.startswith(side)])
        legs.append(Limb((first, second, third), offsets, np.array([0.0, 1.0, 0.0]), sole))
    return tuple(legs)


def packed_legs(figure: mujoco.MjModel) -> Array:
    """`figure_legs` as the kernel takes them, shape (2, 18)."""
    return np.array([leg.packed() for leg in figure_legs(figure)])


def stylus_path(points: Array) -> Array:
    """Stylus poses at points of H with the stylus upright, shape (n, 3) → (n, 7)."""
    return np.hstack((points, np.tile(UPRIGHT, (len(points), 1))))


def _user(config: RunConfig, curve: Trajectory, grabs: tuple[Grab, ...]) -> Arm:
    pushes, turns = config.pushes, config.turns
    laps = range(1, max(2, int(config.seconds / curve.duration)))
    if config.user == "turn" and not turns:
        turns = tuple(turn for lap in laps for turn in lap_turns(lap * curve.duration, curve.duration, lap - 1))
    if config.user == "push" and not pushes:
        pushes = tuple(push for lap in laps for push in lap_pushes(lap * curve.duration, curve.duration))
    if config.user == "trace" and grabs:
        raise ParameterError("a hand that traces cannot grab; choose --user relaxed or push")
    if config.user == "trace":
        times = np.arange(0.0, config.seconds, 0.01)
        return Arm(path=curve.point(times), period=0.01, pushes=pushes, turns=turns)
    return Arm(pushes=pushes, grabs=grabs, turns=turns)


def lap_pushes(start: float, lap: float, force: float = PUSH_FORCE) -> tuple[Push, Push]:
    """A push outwards and one inwards [N] in the lap that begins at a time [s]."""
    return (
        Push(start + 0.1 * lap, 0.3 * lap, force),
        Push(start + 0.6 * lap, 0.3 * lap, -force),
    )
