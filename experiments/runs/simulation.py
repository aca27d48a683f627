"""Simulations from Python: put parts together, run them in memory or into a folder, step them tick by tick."""

import itertools
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console

from controllers.checks import check_field_types, check_kind
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law
from controllers.haptic_map.base import HapticMap
from controllers.safety.energy_tank import EnergyTank
from controllers.safety.limiter import ForceLimiter
from controllers.state import HandState, Wrench, stylus_path
from experiments.config.keywords import with_keyword_messages
from experiments.config.part import to_dict
from experiments.config.run_config import DEFAULT_SEED, REPLAY_WITH_USER, Clock, Figure, Phantom, Replay, check_seed
from experiments.config.run_config import User as RunUser
from experiments.console.compiling import compiler
from experiments.console.estimates import check_length
from experiments.runs.map_objects import BodyMap, RobotArm, own_parts
from experiments.runs.run_result import Run, check_record
from experiments.runs.short_text import short_text
from experiments.setups.parts.budget import WORKSPACE_WIDTH, fastest, tank_for
from experiments.setups.parts.devices import device_of
from experiments.setups.parts.hands import TRACE_SAMPLE_TIME, intent_of, participant
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import ClipMapParts, Notes, Parts
from experiments.setups.session import Session
from experiments.setups.wiring import check_rates, check_seconds, wire_parts
from geometry.arrays import Array
from models.world.scene import SceneConfig
from sim.devices.device import available_ticks
from sim.users.hand.actions import Grab, Push, Turn
from sim.users.hand.arm import Arm
from sim.users.intents.intent import PersonIntent
from sim.users.participant import Participant
from sim.users.person.person import Person
from sim.world.world import BodyKind, World

_DEFAULT_DURATION = 60.0  # [s]


@dataclass(frozen=True, repr=False)
class User:
    """The simulated hand: relaxed or tracing a curve, with pushes, turns and grabs at given times.

    Parameters
    ----------
    pushes, turns, grabs : sequences of Push, Turn, Grab
        Actions of the hand.
    traces : Trajectory, optional
        Curve that the hand traces, again and again.
    person : Person, optional
        Model of the human operator; without it the hand is an arm's impedance, without delay and noise.
    intent : PersonIntent, optional
        What the person intends, one of `hvf.intents`; by default it follows from the other parameters.
    """

    pushes: Sequence[Push] = ()
    turns: Sequence[Turn] = ()
    grabs: Sequence[Grab] = ()
    traces: Trajectory | None = field(default=None, repr=False)
    person: Person | None = None
    intent: PersonIntent | None = None

    @with_keyword_messages()
    def __post_init__(self) -> None:
        check_field_types(self)

    def __repr__(self) -> str:
        return short_text(self)

    @property
    def acts(self) -> bool:
        """Whether the hand acts on its own, or is a person's."""
        does = (self.pushes, self.turns, self.grabs, self.traces, self.person, self.intent)
        return any(part is not None and part != () and part != [] for part in does)

    def hand(self, curve: Trajectory, seconds: float, seed: int) -> Arm | Participant:
        """The hand for a run of `seconds` [s] about a curve, with a seed.

        Raises
        ------
        ParameterError
            If an intent is given without a person, or beside pushes or grabs, or turns with a person.
        SimError
            If the Phantom does not reach what the hand traces.
        """
        if self.traces is not None:
            check_reach(self.traces)
        if self.intent is not None and self.person is None:
            raise ParameterError(f"the intent {type(self.intent).__name__} is a person's; give hvf.User(person=…) too")
        if self.person is not None:
            if self.turns:
                raise ParameterError("a person lets the stylus swing and does not turn it; leave out the turns")
            acts = [name for name in ("pushes", "grabs") if len(getattr(self, name)) > 0]
            if self.intent is not None and acts:
                raise ParameterError(f"a person has one intent at a time; expected an intent or {acts[0]}, not both")
            does = "relaxed" if self.traces is None else "trace"
            user = RunUser(does=does, pushes=tuple(self.pushes), grabs=tuple(self.grabs))
            return participant(self.person, self.intent or intent_of(user), self.traces or curve, seconds, seed)
        if self.traces is None:
            return Arm(pushes=self.pushes, grabs=self.grabs, turns=self.turns)
        path = self.traces.point(np.arange(0.0, seconds + 2.0 * TRACE_SAMPLE_TIME, TRACE_SAMPLE_TIME))
        return Arm(path=path, period=TRACE_SAMPLE_TIME, pushes=self.pushes, grabs=self.grabs, turns=self.turns)


class Tick(NamedTuple):
    """One tick of a simulation that is stepped.

    Attributes
    ----------
    hand : HandState
        Measured state of the hand.
    field : Wrench
        Force and torque of the field.
    force : Array
        Force commanded to the device, after limiter and energy tank, in H [N], shape (3,).
    pose : Array
        The animation h(p), qpos, shape (75,), or joint angles of a robot arm [rad], shape (7,).
    figure : Array
        Simulated pose of the figure, or of the arm; empty without one.
    """

    hand: HandState
    field: Wrench
    force: Array
    pose: Array
    figure: Array

    def __repr__(self) -> str:
        x, y, z = 1e3 * self.hand.p
        force = math.hypot(*self.force)
        return f"<tick at {self.hand.t:.3f} s: tip at ({x:.1f}, {y:.1f}, {z:.1f}) mm, force {force:.2f} N>"


@dataclass(frozen=True, kw_only=True, repr=False)
class Simulation:
    """A hand, a field, a haptic map and a figure, with the device and the clock: all that determines a run.

    Parameters
    ----------
    field : Law
        Law of force: built-in, composed or user-defined.
    haptic_map : BodyMap or HapticMap
        Map from the stylus to the figure, or to a robot arm in its place; a user-defined `HapticMap` is taken to lie
        along the curve of the field.
    user : User
        The simulated hand.
    device : Phantom or Replay
        The device, or the recorded hand that takes its place, without a user.
    figure : Figure
        The figure that plays the animation.
    clock : Clock
        The rates.
    seed : int
        Seed of the start position of the stylus and of a person's noise.
    tank : EnergyTank, optional
        Bound on the energy that the field may inject; by default from the device's force and the curve's speed.

    Raises
    ------
    HvfError
        If a part is of another kind, the rates are not multiples of each other, or a replayed hand has a user.
    """

    field: Law
    haptic_map: BodyMap | HapticMap
    user: User = User()
    device: Phantom | Replay = Phantom()  # noqa: RUF009 - frozen
    figure: Figure = Figure()  # noqa: RUF009
    clock: Clock = Clock()  # noqa: RUF009
    seed: int = DEFAULT_SEED
    tank: EnergyTank | None = None

    @with_keyword_messages()
    def __post_init__(self) -> None:
        _check_kinds(self)
        self.figure.check(leads=False, body=self.body)
        check_seed(self.device, self.seed)
        check_rates(self)
        if isinstance(self.device, Replay) and self.user.acts:
            raise ParameterError(REPLAY_WITH_USER)
        period = self.clock.servo_period
        if self.tank is not None and not np.isclose(self.tank.period, period, rtol=1e-9, atol=0.0):
            raise ParameterError(
                f"tank has a period of {self.tank.period:g} s, by which it is refilled at each tick; expected that of "
                f"the clock, {period:g} s"
            )

    def __repr__(self) -> str:
        return short_text(self)

    @property
    def body(self) -> BodyKind:
        """What follows the hand."""
        return "robot" if isinstance(self.haptic_map, RobotArm) else self.figure.kind

    @property
    def scene(self) -> SceneConfig:
        """Configuration of the world: the figure's size and the rates."""
        figure, clock = self.figure, self.clock
        return SceneConfig(figure.stature, figure.mass, clock.servo_period, clock.physics_step)

    @with_keyword_messages()
    def session(self, seconds: float | None = None) -> Session:
        """The simulation put together for at most `seconds` [s]; compiles what it needs.

        By default that is a minute, or as long as a replayed hand moves.

        Raises
        ------
        HvfError
            If its parts do not fit together.
        """
        check_kind("seconds", seconds, float | None)
        if seconds is not None and not 0.0 < seconds < np.inf:
            raise ParameterError(f"seconds is {seconds:g}; expected more than 0 s, and finite")
        world, console = World(self.scene, self.body), Console(stderr=True)
        device, span = device_of(self, world, seconds), seconds or _DEFAULT_DURATION
        given = self.haptic_map
        if isinstance(given, HapticMap):
            maps = own_parts(given, self._curve())
        else:
            maps = given.parts(world, self.field, bool(self.user.pushes))
        return wire_parts(world, maps, lambda m: self._parts(m, span), compiler(console), device)

    def _curve(self) -> Trajectory:
        """Curve of the first law of the field that has one: a user-defined map lies along it."""
        curves = self.field.curves
        if not curves:
            raise ParameterError("a user-defined map follows the curve of the field; expected a field with a curve")
        return curves[0]

    def _course(self, around: Trajectory) -> Trajectory:
        """The field's curve that lies along the map's, such as one timed by `paced`; else its first; else the map's."""
        places = np.asarray(around.positions)
        for curve in self.field.curves:
            if np.shape(curve.positions) == places.shape and np.allclose(curve.positions, places):
                return curve
        return next(iter(self.field.curves), around)

    def _parts(self, maps: ClipMapParts, seconds: float) -> Parts:
        limiter, program = ForceLimiter(self.clock.servo_period), self.field.program()
        pace = max(map(fastest, self.field.curves or (maps.curve,)))
        power, spring = limiter.peak * pace, (np.inf, WORKSPACE_WIDTH)
        tank = self.tank or tank_for(power, (spring,), maps.reach, limiter)
        handled = tuple((grab.at, grab.end) for grab in self.user.grabs)
        return Parts(
            config=self, maps=maps, field=self.field, program=program, course=self._course(maps.curve),
            user=self.user.hand(maps.curve, seconds, self.seed), tank=tank, gains=maps.gains,
            notes=Notes(type(self.field).__name__.upper(), maps.reach),
            argument_at=lambda nearest, phases: stylus_path(nearest),
            handled=((0.0, np.inf),) if self.user.traces is not None else handled,
        )  # fmt: skip

    @with_keyword_messages(out="record")
    def run(self, seconds: float, record: str | Path | None = None, overwrite: bool = False) -> Run:
        """Run from the start and return the result.

        Parameters
        ----------
        seconds : float
            Simulated time [s].
        record : path, optional
            Folder to write recording, summary, animations, figures and page into; by default a temporary one.
        overwrite : bool
            Replace a run that the folder holds.

        Raises
        ------
        HvfError
            If the parts do not fit together, or the folder cannot be written or holds a run.
        """
        check_kind("seconds", seconds, float)
        check_record(record, overwrite)
        check_seconds(self, seconds)
        check_length(Path(record or tempfile.gettempdir()), seconds, self.clock.servo_period)
        return Run.of(self.session(seconds), self.description(), seconds, record, overwrite)

    def __iter__(self) -> Iterator[Tick]:
        """Step tick by tick, without end or to the end of a replayed hand: ``for tick in sim``."""
        session = self.session()
        loop = session.loop()
        left, world = available_ticks(session.servo.device), session.world
        body = slice(world.pose_at, world.pose_at + world.body.nq)
        for _ in itertools.count() if left is None else range(left):
            with session.naming_laws():
                ticks, frames = loop.step()
            session.haptic_map.check()
            force, torque = ticks.field[0, :3].copy(), ticks.field[0, 3:].copy()
            yield Tick(
                HandState.of(ticks.hand[0]), Wrench(force, torque), ticks.force[0].copy(),
                session.servo.reference.pose.copy(), frames.qpos[0, body].copy(),
            )  # fmt: skip

    def description(self) -> dict[str, object]:
        """What the simulation is made of, in plain data, as its recordings store it."""
        clips = getattr(self.haptic_map, "clips", ())
        return {
            "simulation": "of Python objects; the script that made it makes it again",
            "field": self.field.description(),
            "map": {"kind": type(self.haptic_map).__name__, "clips": [clip.name for clip in clips]},
            "clock": {"servo_period": self.clock.servo_period, "physics_step": self.clock.physics_step},
            "device": to_dict(self.device),
            "seed": self.seed,
        }


_PART_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "field": ((Law,), "a law of force, such as hvf.Follow(curve, k_r=300, b_d=8), or a function under @hvf.law"),
    "user": ((User,), "hvf.User(…)"),
    "device": ((Phantom, Replay), "hvf.Phantom(…) or hvf.Replay(run)"),
    "figure": ((Figure,), 'hvf.Figure(…), such as hvf.Figure(kind="none")'),
    "clock": ((Clock,), "hvf.Clock(…)"),
    "seed": ((int, np.integer), "a whole number, 0 or more and less than 9223372036854775808"),
    "tank": ((EnergyTank, type(None)), "hvf.EnergyTank(…)"),
}


def _check_kinds(sim: Simulation) -> None:
    """Refuse parts of a wrong type, with the part's name and what is expected."""
    for name, (kinds, expected) in _PART_TYPES.items():
        if not isinstance(getattr(sim, name), kinds) or isinstance(getattr(sim, name), bool):
            raise ParameterError(f"{name} is {getattr(sim, name)!r}; expected {expected}")
    given = sim.haptic_map
    if isinstance(given, type) or not (isinstance(given, HapticMap) or hasattr(given, "parts")):
        raise ParameterError(f"haptic_map is {given!r}; expected a map, such as hvf.Cylindrical(clips, around=curve)")
    if not 0 <= sim.seed < 2**63:
        raise ParameterError(f"seed is {sim.seed!r}; expected {_PART_TYPES['seed'][1]}")
