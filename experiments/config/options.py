"""Flat options of a run, as on the command line: made from the parts of a configuration, and sorted into them.

Each field of a part is an option of the same name. A given option that does not belong to the chosen parts is refused
by name: nothing is ignored.
"""

import types
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints

import docstring_parser
import tyro

from controllers.errors import ParameterError
from experiments.config.maps import MAP_SUFFIX, MAPS, Circle, Led, MapFile, RobotArm
from experiments.config.modes import MODES, NO_DRAG, JointWalls, OrientationMoment, Rivers, SpeedGovernor, gates_rivers
from experiments.config.paths import load_config
from experiments.config.run_config import (
    LEAD_WITHOUT_FIGURE,
    NO_SEED,
    PERSON_INTENTS,
    Clock,
    Does,
    Figure,
    FigureKind,
    Phantom,
    Replay,
    RunConfig,
    User,
    meaningless_option_error,
    meaningless_options,
)
from sim.users.person.population import PERSONAS, persona

OPTIONAL_PARTS = {"orientation": OrientationMoment, "governor": SpeedGovernor, "walls": JointWalls}
"""Optional parts of a mode: an option of its name switches one on, or any of its numbers where those default to 0."""
_SWITCHES = ("governor", "walls")
_USER_KINDS = tuple(kind for kind in get_args(Does) if kind != "lead")
_NON_OPTIONS = {"kind", "around", "does", "pushes", "turns", "grabs", "file", *OPTIONAL_PARTS}
_HAND_OPTIONS = {"user", "person", "pushes", "turns", "grabs"}


@dataclass(frozen=True)
class Option:
    """An option: its type, what it means, and the parts that it belongs to."""

    hint: Any
    help: str
    parts: tuple[type, ...]


def parameters(cls: type) -> dict[str, str]:
    """Descriptions of the parameters of a part, by name, from its docstring."""
    described = docstring_parser.parse(cls.__doc__ or "")
    found: dict[str, str] = {}
    for parameter in described.params:
        for name in parameter.arg_name.split(", "):
            found[name] = " ".join((parameter.description or "").split())
    return found


def _vocabulary() -> dict[str, Option]:
    """All options by name."""
    words: dict[str, Option] = {}
    for cls in (*MODES, *OPTIONAL_PARTS.values(), *MAPS, Led, Circle, Figure, Phantom, Clock):
        hints, help_texts = get_type_hints(cls), parameters(cls)
        for option in fields(cast(Any, cls)):
            if option.name in _NON_OPTIONS:
                continue
            default = cast(Any, cls).__pydantic_fields__[option.name].default
            help_text = help_texts.get(option.name, "")
            known = words.get(option.name)
            if known is None:
                shown = " ".join(cast(tuple[str, ...], default)) if isinstance(default, tuple) else default
                default_text = f" Default: {shown}." if default not in (None, "", False) else ""
                words[option.name] = Option(optional_type(hints[option.name]), help_text + default_text, (cls,))
            else:
                words[option.name] = Option(known.hint, known.help, (*known.parts, cls))
    return words


def optional_type(hint: Any) -> Any:
    """The type of an option that may be left out."""
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(inner for inner in get_args(hint) if inner is not type(None))
    return hint if hint is bool or get_origin(hint) is tuple else hint | None


def _metavar(kind: Any) -> str | None:
    """Placeholder of a value in the help: a type or the choices, without None."""
    inner = [k for k in get_args(kind) if k is not type(None)] if type(None) in get_args(kind) else []
    if not inner:
        return None
    choices = get_args(inner[0]) if get_origin(inner[0]) is Literal else ()
    return "{" + ",".join(map(str, choices)) + "}" if choices else inner[0].__name__.upper()


VOCABULARY = _vocabulary()


def run_config(
    mode: str = "follow", map: str = "", user: str = "", figure: str = "physical", replay: str = "", **words: object
) -> RunConfig:
    """Configuration of a run from options, as on the command line.

    Parameters
    ----------
    mode : str
        Kind of one of `experiments.config.modes`.
    map : str
        Kind of one of `experiments.config.maps`, or a map's file (.npz); by default "cylindrical".
    user : str
        What the hand does; by default it is relaxed.
    figure : str
        Kind of the figure: physical, kinematic or none.
    replay : str
        Folder of a run whose hand is replayed in place of the Phantom.
    **words
        Fields of the parts by name, and `seconds`, `seed`, `pushes`, `turns`, `grabs`.

    Raises
    ------
    ParameterError
        If there is no such mode, map or option, an option does not belong to the chosen parts, or a number is out of
        its interval.
    """
    given = dict(words)
    _check_option_types(given, {"mode": mode, "map": map, "user": user, "figure": figure, "replay": replay})
    mode_cls = _part_of_kind("mode", mode, MODES)
    if mode == "lead":
        _check_leading(map, user, figure)
        map_cls, user = Led, "lead"
    elif map.endswith(MAP_SUFFIX):
        map_cls = MapFile
        given["file"] = map
    else:
        map_cls = _part_of_kind("map", map or "cylindrical", tuple(cls for cls in MAPS if cls is not MapFile))
    if mode != "lead" and user and user not in _USER_KINDS:
        raise ParameterError(f"no user {user!r}; there are {', '.join(_USER_KINDS)}")
    if figure not in get_args(FigureKind):
        raise ParameterError(f"--figure is {figure!r}; expected {', '.join(get_args(FigureKind))}")
    _refuse_meaningless(given, mode, "robot" if map_cls is RobotArm else figure, replay)
    chosen = {"mode": mode, "map": map, "replay": replay}
    options = _GivenOptions(given, " ".join(f"--{name} {value}" for name, value in chosen.items() if value))
    hand = options.of(User)
    if isinstance(hand.get("person"), str):
        hand["person"] = persona(hand["person"])
    mode_part = mode_cls(**options.added(mode_cls), **options.of(mode_cls))
    around = {"around": Circle(**options.of(Circle))} if "around" in _field_names(map_cls) else {}
    config = RunConfig(
        mode=mode_part,  # pyright: ignore[reportArgumentType]
        map=map_cls(**options.of(map_cls), **around),  # pyright: ignore[reportArgumentType]
        user=User(does=user or "relaxed", **hand),  # pyright: ignore[reportArgumentType]
        figure=Figure(kind=figure, **options.of(Figure)),  # pyright: ignore[reportArgumentType]
        device=Replay(replay) if replay else Phantom(**options.of(Phantom)), clock=Clock(**options.of(Clock)),
        **options.of(RunConfig, ("seconds", "seed")),
    )  # fmt: skip
    options.check_empty()
    return config


def _check_option_types(words: Mapping[str, object], chosen: Mapping[str, object]) -> None:
    """Refuse names that are not text, switches that are not bool, and fields that are not options."""
    for name, value in chosen.items():
        if not isinstance(value, str):
            raise ParameterError(f"--{name} is {value!r}; expected a name")
    for name in _SWITCHES:
        if not isinstance(words.get(name, False), bool):
            raise ParameterError(f"--{name} is {words[name]!r}; expected true or false")
    for name in sorted({"around", "does", "file", "orientation", "run"} & words.keys()):
        raise _unknown_option(f"--{name}")


def _check_leading(map: str, user: str, figure: str) -> None:
    """Refuse a map and a user in the mode lead, which has its own, and a figure that cannot be led."""
    wrong = [f"--{name} {value}" for name, value in (("map", map), ("user", user)) if value]
    if wrong:
        raise ParameterError(
            f"in the mode lead the map is the led figure's and the hand leads; leave out {', '.join(wrong)}"
        )
    if figure == "none":
        raise ParameterError(LEAD_WITHOUT_FIGURE)


def _refuse_meaningless(given: Mapping[str, object], mode: str, body: str, replay: str) -> None:
    """Refuse options that have no effect on the chosen parts, even if their value is the default."""
    for name in meaningless_options(body, mode == "lead"):
        if name in given:
            raise meaningless_option_error(name, given[name], body)
    if replay and "seed" in given:
        raise ParameterError(NO_SEED)
    if mode == "rivers" and "governor_drag" in given and gates_rivers(str(given.get("crossing", ""))):
        raise ParameterError(NO_DRAG)


def _unknown_option(option: str) -> ParameterError:
    return ParameterError(f"{option} is not known; there are {', '.join(sorted(VOCABULARY))}")


def _part_of_kind(what: str, name: str, parts: tuple[type, ...]) -> Any:
    kinds = _parts_by_kind(parts)
    if name not in kinds:
        known = ", ".join(kinds)
        raise ParameterError(f"no {what} {name!r}; there are {known}" + (", or give a file (.npz)" * (what == "map")))
    return kinds[name]


def _parts_by_kind(parts: tuple[type, ...]) -> dict[str, type]:
    return {cast(Any, cls).__pydantic_fields__["kind"].default: cls for cls in parts}


def _field_names(cls: type) -> set[str]:
    return {option.name for option in fields(cast(Any, cls))} - {"kind"}


class _GivenOptions:
    """Given options, from which each part takes those that belong to it."""

    def __init__(self, given: dict[str, object], chosen: str):
        self._given, self._chosen = given, chosen

    def of(self, cls: type, names: Iterable[str] = ()) -> dict[str, Any]:
        """Take the options of a part, or those of the given names."""
        return {name: self._given.pop(name) for name in sorted(names or _field_names(cls)) if name in self._given}

    def added(self, mode: type) -> dict[str, Any]:
        """Take the optional parts of a mode."""
        found: dict[str, Any] = {}
        for name, cls in OPTIONAL_PARTS.items():
            if name not in _field_names(mode):
                continue
            switched = bool(self._given.pop(name, False))
            if switched or (name not in _SWITCHES and _field_names(cls) & self._given.keys()):
                found[name] = cast(Any, cls)(**self.of(cls))
        return found

    def check_empty(self) -> None:
        """Refuse options that no part has taken."""
        remaining = {name: value for name, value in self._given.items() if value is not False}
        if not remaining:
            return
        name = next(iter(remaining))
        owners = [_choice_option(cls) for cls in VOCABULARY[name].parts] if name in VOCABULARY else []
        if name in OPTIONAL_PARTS:
            owners = [_choice_option(cls) for cls in MODES if name in _field_names(cls)]
        option = "--" + name.replace("_", "-")
        if not owners:
            raise _unknown_option(option)
        raise ParameterError(f"{option} has no meaning with {self._chosen}; it belongs to {', '.join(owners)}")


def _choice_option(cls: type) -> str:
    """How a part is chosen on the command line."""
    added = next((name for name, part in OPTIONAL_PARTS.items() if part is cls), None)
    if added in _SWITCHES:
        return f"--{added}"
    if added is not None:
        return ", ".join(_choice_option(mode) for mode in MODES if added in _field_names(mode))
    kind = cast(Any, cls).__pydantic_fields__.get("kind")
    what = "--map" if cls in MAPS else "--mode"
    if cls is MapFile:
        return "--map FILE.npz"
    if cls is Phantom:
        return "the Phantom, without --replay"
    if cls is Circle:
        return "maps about a circle"
    return f"{what} {kind.default}" if kind is not None and cls is not Led else "--mode lead"


def option(name: str, kind: Any, text: str, default: Any) -> tuple[str, Any, Any]:
    """Field of a dataclass of options: its name, its type with its help, and its default."""
    shown = tyro.conf.arg(help=text, help_behavior_hint="", metavar=_metavar(kind))
    return name, Annotated[kind, shown], field(default=default)


CONFIG_HELP = "A configuration in a JSON file, from whose folder its relative paths start; other options change it."


def _options() -> Iterator[tuple[str, Any, Any]]:
    """Fields of the options' dataclass."""
    top, needs = parameters(RunConfig), ", ".join(PERSON_INTENTS) + " need"
    yield option("config", Path | None, CONFIG_HELP, None)
    yield option("mode", str, "Field of force: " + ", ".join(_parts_by_kind(MODES)) + ".", "")
    yield option("map", str, "Haptic map: cylindrical, composite, rivers, robot-arm, or a map's file (.npz).", "")
    yield option("user", str, f"The simulated hand: {', '.join(_USER_KINDS)}; {needs} a person.", "")
    yield option("person", str, "Whose hand it is: " + ", ".join(PERSONAS) + ", or SEED:PLACE of a population.", "")
    yield option("figure", str, "The figure: physical, kinematic (not in the physics), or none.", "")
    yield option("replay", str, "Folder of a run whose hand is replayed: it moves as recorded, whatever the force.", "")
    yield option("seconds", float | None, top["seconds"] + " Default: 20.", None)
    yield option("seed", int | None, top["seed"] + " Default: 1.", None)
    for name in _SWITCHES:
        yield option(name, bool, (OPTIONAL_PARTS[name].__doc__ or "").strip().split("\n")[0], False)
    for name, word in VOCABULARY.items():
        yield option(name, word.hint, word.help, () if name == "clips" else False if word.hint is bool else None)


RunOptions = make_dataclass("RunOptions", list(_options()), frozen=True)
"""The options of a run on the command line; one that is not given is None, False or empty."""
Options = Annotated[RunOptions, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="run")]  # pyright: ignore
"""`RunOptions` as a field of a command that has options of its own too."""


def given_options(options: object) -> dict[str, Any]:
    """Options that are given, by name."""
    given = {f.name: getattr(options, f.name) for f in fields(cast(Any, options)) if f.default is not MISSING}
    # A zero counts as given, although it equals False.
    return {name: value for name, value in given.items() if value is not False and value not in (None, "", ())}


def config_of_options(options: object) -> RunConfig:
    """The configuration that options ask for: given options change that of ``--config``, if there is one.

    Raises
    ------
    ParameterError, SimError
        As `run_config`, or if the file holds no configuration.
    """
    given = given_options(options)
    file = given.pop("config", None)
    return run_config(**given) if file is None else with_options(load_config(cast(Path, file)), given)


def with_options(config: RunConfig, words: Mapping[str, object]) -> RunConfig:
    """A configuration with some options changed; a mode or a map of another kind starts from its own defaults.

    Raises
    ------
    ParameterError
        As `run_config`.
    """
    unchanged, dropped = options_of(config), set[str]()
    mode, map = words.get("mode", config.mode.kind), str(words.get("map", config.map.kind))
    leads = (mode == "lead") != config.leads
    if mode != config.mode.kind:
        dropped |= _field_names(type(config.mode)).union(
            OPTIONAL_PARTS, *(_field_names(cls) for cls in OPTIONAL_PARTS.values())
        )
    if leads or ("file" if map.endswith(MAP_SUFFIX) else map) != config.map.kind:
        dropped |= _field_names(type(config.map)) | _field_names(Circle) | {"map"}
    if leads:
        dropped |= {"user", "pushes", "turns", "grabs"}
    if words.get("replay"):
        dropped |= _HAND_OPTIONS | _field_names(Phantom) | {"seed"}
    if mode == "rivers" and gates_rivers(str(words.get("crossing", unchanged.get("crossing")))):
        dropped.add("governor_drag")
    body = "robot" if map == RobotArm.kind else str(words.get("figure", config.figure.kind))
    dropped |= set(meaningless_options(body, mode == "lead"))
    unchanged = {name: value for name, value in unchanged.items() if name not in dropped}
    return run_config(**(unchanged | dict(words)))  # pyright: ignore[reportArgumentType]


def options_of(config: RunConfig) -> dict[str, object]:
    """The options of a configuration: the inverse of `run_config`."""
    words: dict[str, object] = {
        "seconds": config.seconds,
        "seed": config.seed,
        "mode": config.mode.kind,
        "figure": config.figure.kind,
    }
    if not config.leads:
        words |= {"map": config.map.kind, "user": config.user.does}
    for part in (config.mode, config.map, config.user, config.figure, config.device, config.clock):
        words |= {
            name: getattr(part, name)
            for name in _field_names(type(part)) - {"does", "file", "run", *OPTIONAL_PARTS, "around"}
        }
    for name, cls in OPTIONAL_PARTS.items():
        part = getattr(config.mode, name, None)
        if part is not None:
            words |= {word: getattr(part, word) for word in _field_names(cls)} | (
                {name: True} if name in _SWITCHES else {}
            )
    idle = set(meaningless_options(config.body, config.leads))
    if isinstance(config.mode, Rivers) and gates_rivers(config.mode.crossing):
        idle.add("governor_drag")
    if isinstance(config.device, Replay):
        idle.add("seed")
    words = {name: value for name, value in words.items() if name not in idle}
    if isinstance(config.map, MapFile):
        words["map"] = config.map.file
    if isinstance(config.device, Replay):
        words["replay"] = config.device.run
    around = getattr(config.map, "around", None)
    if around is not None:
        words |= {"lap": around.lap, "radius": around.radius, "wave": around.wave}
    return words
