"""The configuration of a run: pure data, stored as one JSON file beside the results."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, cast, get_args

from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, model_serializer

from controllers.errors import ParameterError
from experiments.config.keywords import with_keyword_messages
from experiments.config.maps import Cylindrical, Led, Map, RobotArm
from experiments.config.modes import Follow, Lead, Mode, StretchThenFollow
from experiments.config.part import above, at_least, part, whole_number
from models.humanoid.skeleton import DEFAULT_MASS, DEFAULT_STATURE
from models.world.scene import SceneConfig
from sim.body.figure_state import FigureGains
from sim.users.hand.actions import Grab, Push, Turn
from sim.users.intents import ChangeOver, CutCorner, Exaggerate, GetLost, Resist
from sim.users.intents.intent import PersonIntent
from sim.users.person.person import Person
from sim.world.world import BodyKind, FigureKind

Does = Literal["relaxed", "trace", "push", "turn", "lead", "exaggerate", "cut", "change", "resist", "lost"]
PERSON_INTENTS: Mapping[Does, PersonIntent] = {
    "exaggerate": Exaggerate(), "cut": CutCorner(), "change": ChangeOver(), "resist": Resist(), "lost": GetLost(),
}  # fmt: skip
"""What only a person can do, since it takes sight and touch."""


@part
class User:
    """The simulated hand.

    Parameters
    ----------
    does : Does
        A hand that lets go; one that traces the curve by itself; one that pushes; one that turns the stylus; and the
        one that leads a figure. A person also exaggerates here and calms there, cuts a corner, changes over to another
        motion, resists, or gets lost and comes back.
    pushes : tuple of Push
        By default, for a hand that pushes: outwards and inwards once a lap from the second lap on, or sooner if the
        run ends by then; on rivers over into another one; on the rivers of a lifted map at the best transition, and
        three laps later back.
    turns : tuple of Turn
        By default, for a hand that turns: one lap to the left and right, one down and up, one over to either side.
    grabs : tuple of Grab
        By default, where a curve is stretched: a tour of what can be done.
    person : Person, optional
        Whose hand it is; without one it is an arm's impedance, with no delay and no noise.
    """

    does: Does = "relaxed"
    pushes: tuple[Push, ...] = ()
    turns: tuple[Turn, ...] = ()
    grabs: tuple[Grab, ...] = ()
    person: Person | None = None

    def __post_init__(self) -> None:
        if self.person is None and self.does in PERSON_INTENTS:
            raise ParameterError(f"the user {self.does!r} takes sight and touch; add a person, such as --person median")
        if self.person is not None and (self.does == "turn" or self.turns):
            raise ParameterError(
                "a person lets the stylus swing and does not turn it; leave out the person or the turn"
            )
        for name in ("pushes", "turns", "grabs"):
            if self.does == "lead" and getattr(self, name):
                raise ParameterError(f"a hand that leads follows its own path; leave out its {name}")
        if self.person is not None and self.pushes and self.traces:
            raise ParameterError(f"a person either pushes or has the intent {self.does!r}; leave out one of them")
        if self.person is not None and self.pushes and self.grabs:
            raise ParameterError("a person either pushes or grabs; choose --user relaxed where a curve is bent")
        if self.traces and self.grabs:
            raise ParameterError("a hand that traces cannot grab; choose --user relaxed, push or turn")

    @property
    def traces(self) -> bool:
        """Whether the hand moves along a path of its own."""
        return self.does == "trace" or self.does in PERSON_INTENTS


_ANIMATION_OPTIONS, _RESIDUAL_OPTIONS = ("smoothing", "figure_ticks", "blend"), ("residual_force", "residual_moment")
_MEANINGLESS_SIZES: dict[BodyKind, tuple[str, ...]] = {
    "physical": (), "kinematic": ("mass",), "none": ("stature", "mass"), "robot": ("stature", "mass")
}  # fmt: skip
MEANINGLESS_OPTIONS: dict[BodyKind, tuple[str, ...]] = {
    "physical": (), "kinematic": _RESIDUAL_OPTIONS, "none": (*_ANIMATION_OPTIONS, *_RESIDUAL_OPTIONS),
    "robot": ("blend", *_RESIDUAL_OPTIONS)
}  # fmt: skip
"""Numbers of a figure that have no meaning for a kind of body, whatever is played."""


def meaningless_options(body: str, leads: bool) -> tuple[str, ...]:
    """Numbers of a figure that have no meaning for a kind of body; the size of a led figure always has one."""
    kind = cast(BodyKind, body)
    return MEANINGLESS_OPTIONS.get(kind, ()) + (() if leads else _MEANINGLESS_SIZES.get(kind, ()))


def meaningless_option_error(name: str, value: object, body: str) -> ParameterError:
    """The error that a number of a figure has no meaning for a kind of body; it names the figures that have it."""
    others = [other for other in get_args(FigureKind) if name not in meaningless_options(other, leads=False)]
    chosen = "a robot arm" if body == "robot" else f"--figure {body}"
    return ParameterError(
        f"--{name.replace('_', '-')} {value} has no meaning with {chosen}; it belongs to --figure {', '.join(others)}"
    )


@part
class Figure:
    """The figure that plays the animation; its kind determines which of its numbers have a meaning.

    A kinematic figure has no mass and no residual. Without a figure there is no size, no filter and no update. A led
    figure always has its size, by which the floor is scaled.

    Parameters
    ----------
    kind : {"physical", "kinematic", "none"}
        In the physics, with torques and contacts; the animation itself, evaluated and recorded, which is faster; or the
        device alone, for tuning.
    stature : float
        Height of the figure [m]; it moves as the clips do, in proportion.
    mass : float
        Mass of the figure [kg].
    smoothing : float
        Bandwidth of the filter between stylus and figure [Hz].
    figure_ticks : int
        Servo ticks between two updates of the figure, between which a foot may land.
    blend : float
        Duration of the blend from one clip to another [s].
    residual_force : float
        Largest residual force at the root, as a fraction of body weight [1]; 0: none.
    residual_moment : float
        Largest residual moment, as a fraction of body weight × stature [1].
    """

    kind: FigureKind = "physical"
    stature: float = above(0.0, default=DEFAULT_STATURE, unit="m")
    mass: float = above(0.0, default=DEFAULT_MASS, unit="kg")
    smoothing: float = above(0.0, default=6.0, unit="Hz")
    figure_ticks: int = whole_number(1, default=2)
    blend: float = at_least(0.0, default=0.4, unit="s")
    residual_force: float = at_least(0.0, default=FigureGains().force_bound)
    residual_moment: float = at_least(0.0, default=FigureGains().moment_bound)

    def __post_init__(self) -> None:
        self.check(leads=True, body=self.kind)

    @with_keyword_messages(figure="kind")
    def check(self, leads: bool, body: BodyKind) -> None:
        """Refuse numbers that have no meaning for a kind of body, led or not.

        Raises
        ------
        ParameterError
            If there is one; the message names the kinds of figure that have it.
        """
        if body == "robot" and self.kind != "physical":
            raise ParameterError(f"a robot arm takes the figure's place; leave out --figure {self.kind}")
        for name in meaningless_options(body, leads):
            value = getattr(self, name)
            if value != FIGURE_DEFAULTS[name]:
                raise meaningless_option_error(name, f"{value:g}", body)

    def as_kind(self, kind: FigureKind, leads: bool) -> "Figure":
        """The same figure as another kind; numbers that have no meaning for that kind get their defaults."""
        return replace(self, kind=kind, **{name: FIGURE_DEFAULTS[name] for name in meaningless_options(kind, leads)})

    @model_serializer(mode="wrap")
    def _serialise(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Content of a file: only numbers that have a meaning for the kind."""
        return self._meaningful_values(cast(dict[str, Any], plain(self)))

    def _meaningful_values(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Those of the numbers that have a meaning, and others that were given, such as the size of a led figure."""
        idle = meaningless_options(self.kind, leads=False)
        return {name: value for name, value in values.items() if name not in idle or value != FIGURE_DEFAULTS[name]}

    def __repr__(self) -> str:
        meant = self._meaningful_values({name: getattr(self, name) for name in FIGURE_DEFAULTS})
        return f"Figure({', '.join(f'{name}={value!r}' for name, value in meant.items())})"


FIGURE_DEFAULTS = {name: field.default for name, field in cast(Any, Figure).__pydantic_fields__.items()}
"""Default of each number of a figure."""


@part
class Phantom:
    """The PHANToM.

    Parameters
    ----------
    cutoff : float
        Corner frequency of its velocity filter [Hz].
    device_file : str
        Parameters from `hvf hardware identify`; by default the published ones.
    """

    kind: Literal["phantom"] = "phantom"
    cutoff: float = above(0.0, default=150.0, unit="Hz")
    device_file: str = ""


@part
class Replay:
    """The hand of a recording in place of a device: it moves as it was recorded, whatever the force.

    The run begins where that hand was, so that it has no seed.

    Parameters
    ----------
    run : str
        Folder of the run whose hand is replayed.
    """

    kind: Literal["replay"] = "replay"
    run: str = Field(kw_only=False, min_length=1)


def _with_kind(value: object) -> object:
    """A device in a file is a Phantom if it does not say what it is."""
    return {"kind": "phantom", **cast(Mapping[str, object], value)} if isinstance(value, Mapping) else value


Device = Annotated[Phantom | Replay, Field(discriminator="kind"), BeforeValidator(_with_kind)]


def phantom_of(device: Phantom | Replay) -> Phantom:
    """The same device, which has to be a Phantom.

    Raises
    ------
    ParameterError
        If it is a replayed hand.
    """
    if isinstance(device, Replay):
        raise ParameterError(
            f"the hand of {device.run} is replayed and feels no force; expected a Phantom: leave out --replay"
        )
    return device


MAX_SERVO_PERIOD = 0.01
"""Longest servo period [s]: half the rate of a slower servo nears the 40 Hz above which oscillation is measured."""


@part
class Clock:
    """The rates of a run.

    Parameters
    ----------
    servo_period : float
        Time between two servo ticks [s]; at most 10 ms.
    physics_step : float
        Time step of the physics [s]; divides the servo period.
    """

    servo_period: Annotated[float, above(0.0, unit="s", most=MAX_SERVO_PERIOD)] = 1e-3
    physics_step: Annotated[float, above(0.0, unit="s")] = 5e-4


REPLAY_WITH_USER = "a replayed hand has no simulated user; leave out the user and what it does, or the replay"
DEFAULT_SEED = 1
"""Seed of a run that is given none."""
NO_SEED = "a replayed hand begins where it was recorded, whatever the seed; leave out the seed, or the replay"
LEAD_WITHOUT_FIGURE = "the mode lead with the figure none: nobody to lead; expected another figure"


def check_seed(device: Device, seed: int) -> None:
    """Refuse a seed beside a replayed hand."""
    if isinstance(device, Replay) and seed != DEFAULT_SEED:
        raise ParameterError(NO_SEED)


@part
class RunConfig:
    """A run: everything that determines what happens.

    Parameters
    ----------
    mode : Follow, Bunny, Rivers, Stretch, StretchThenFollow or Lead
        Field of force.
    map : Cylindrical, Composite, RiverClips, MapFile, RobotArm or Led
        Haptic map, with its clips and its curve.
    user, figure, device, clock
        The simulated hand, the figure, the device and the rates.
    seconds : float
        Simulated time [s].
    seed : int
        Seed of the exact place where the hand starts; a replayed hand has none.
    """

    mode: Mode = Follow()
    map: Map = Cylindrical()
    user: User = User()
    figure: Figure = Figure()
    device: Device = Phantom()
    clock: Clock = Clock()
    seconds: float = above(0.0, default=20.0, unit="s")
    seed: int = whole_number(0, default=DEFAULT_SEED)

    def __post_init__(self) -> None:
        if self.leads != isinstance(self.map, Led):
            raise ParameterError("a figure is led by the mode lead and its own map; expected both, or neither")
        if self.leads != (self.user.does == "lead"):
            raise ParameterError(
                f"the user {self.user.does!r} and the mode {self.mode.kind!r}: a hand leads in the mode lead only"
            )
        self.figure.check(self.leads, self.body)
        for name in ("governor", "walls"):
            if self.body == "robot" and getattr(self.mode, name, None) is not None:
                raise ParameterError(f"--{name} is for a figure, and a robot arm is in its place; leave it out")
        check_seed(self.device, self.seed)
        if isinstance(self.device, Replay):
            if self.user != User(does="lead" if self.leads else "relaxed"):
                raise ParameterError(REPLAY_WITH_USER)
            if isinstance(self.mode, StretchThenFollow):
                raise ParameterError(
                    "the mode stretch-then-follow performs when the simulated hand has bent the curve, and a replayed "
                    "hand does not determine when; expected another mode, such as stretch"
                )

    @property
    def leads(self) -> bool:
        """Whether the hand leads a walking figure."""
        return isinstance(self.mode, Lead)

    @property
    def body(self) -> BodyKind:
        """What follows the hand."""
        return "robot" if isinstance(self.map, RobotArm) else self.figure.kind

    @property
    def scene(self) -> SceneConfig:
        """Configuration of the world: the figure's size and the rates."""
        figure, clock = self.figure, self.clock
        return SceneConfig(figure.stature, figure.mass, clock.servo_period, clock.physics_step)

    @model_serializer(mode="wrap")
    def _serialise(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Content of a file: without numbers of the figure that have no meaning for a robot arm in its place."""
        held = cast(dict[str, Any], plain(self))
        if self.body == "robot":
            idle = ("kind", *meaningless_options("robot", leads=False))
            held["figure"] = {name: value for name, value in held["figure"].items() if name not in idle}
        return held
