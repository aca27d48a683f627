"""Configurations: every number is bounded, every option has its place, and JSON and words round-trip."""

import json
from dataclasses import fields, is_dataclass, replace
from math import inf, nan
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

from controllers.errors import ParameterError
from experiments.cli import parse_command
from experiments.config.keywords import option_message
from experiments.config.maps import MAPS, Circle, Composite, Cylindrical, Led, MapFile, RiverClips, RobotArm
from experiments.config.modes import (
    MODES,
    Bunny,
    Follow,
    JointWalls,
    Lead,
    OrientationMoment,
    Rivers,
    SpeedGovernor,
    Stretch,
    StretchThenFollow,
)
from experiments.config.options import (
    OPTIONAL_PARTS,
    VOCABULARY,
    RunOptions,
    config_of_options,
    options_of,
    run_config,
    with_options,
)
from experiments.config.part import above, at_least, from_dict, from_json, part, to_dict, to_json, whole_number
from experiments.config.paths import load_config
from experiments.config.run_config import Clock, Figure, Phantom, Replay, RunConfig, User
from experiments.hardware.parts import served, session_of
from experiments.setups.wiring import wire
from sim.errors import SimError
from sim.users.hand.actions import Grab, Push, Turn
from sim.users.person.person import Person
from sim.users.person.population import persona

PARTS = (*MODES, *OPTIONAL_PARTS.values(), *MAPS, Led, Circle, User, Figure, Phantom, Replay, Clock, RunConfig)
NEEDED: dict[type, dict[str, object]] = {MapFile: {"file": "map.npz"}, Replay: {"run": "runs/mine"}}
PUSHES = (Push(0.5, 0.3, -2.0), Push(1.0, 0.2, 1.0, (0.0, 0.0, 1.0), (0.05, 0.0, 0.0)))
TURNS, GRABS = (Turn(0.0, 1.0, 0.5, (0.0, 0.0, 1.0)),), (Grab(1.0, (0.0, 0.01, 0.0), place=(0.05, 0.0, 0.0)),)


def _kinds(hint: object) -> set[object]:
    return {hint, *get_args(hint)}


def _numbers(cls: type) -> dict[str, object]:
    """Names and type hints of the numeric fields of a part."""
    hints = get_type_hints(cls)
    return {name: hint for name, hint in hints.items() if _kinds(hint) & {int, float}}


def _limits(cls: Any, name: str) -> dict[str, Any]:
    """Bounds of a numeric field of a part."""
    found: dict[str, Any] = {}
    for bound in cls.__pydantic_fields__[name].metadata:
        found |= {key: getattr(bound, key) for key in ("ge", "gt", "lt", "allow_inf_nan") if hasattr(bound, key)}
    return found


NUMBERS = [(cls, name) for cls in PARTS for name in _numbers(cls)]


def make_part(cls: type, **values: object) -> Any:
    return cls(**NEEDED.get(cls, {}), **values)


@part
class Inner:
    length: float = above(0.0, default=1.0, unit="m")


@part
class Outer:
    wide_gap: float | None = at_least(0.5, default=None, unit="s")
    reach: float = at_least(1.0, default=2.0, infinite=True)
    count: int = whole_number(2, default=2)
    name: str = "any"
    inner: Inner = Inner()


def test_every_number_of_a_configuration_has_bounds() -> None:
    assert len(NUMBERS) > 50
    for cls, name in NUMBERS:
        limits = _limits(cls, name)
        assert {"ge", "gt"} & set(limits), (cls, name)
        assert "lt" in limits or "allow_inf_nan" in limits, (cls, name)


def test_parts_list_covers_the_whole_run_configuration() -> None:
    """Every dataclass nested in a configuration is one of the parts above."""
    found, waiting = set[type](), [RunConfig]
    while waiting:
        cls = waiting.pop()
        found.add(cls)
        for hint in get_type_hints(cls).values():
            inner = [hint]
            while inner:
                one = inner.pop()
                inner.extend(get_args(one))
                if isinstance(one, type) and is_dataclass(one) and one not in found:
                    waiting.append(one)
    assert found == {*PARTS, Push, Turn, Grab, Person}


@pytest.mark.parametrize(("cls", "name"), NUMBERS, ids=lambda value: getattr(value, "__name__", value))
def test_number_outside_its_interval_is_refused_by_name(cls: type, name: str) -> None:
    limits, flag = _limits(cls, name), "--" + name.replace("_", "-")
    is_whole = float not in _kinds(_numbers(cls)[name])
    wrong: list[float] = [-1] if is_whole else [-1.0, -inf, nan]
    wrong += [0] * ("gt" in limits or limits["ge"] > 0) + [inf] * (limits.get("allow_inf_nan") is False)
    for value in wrong:
        with pytest.raises(ParameterError, match=rf"^{name} is {value:g}; expected ") as error:
            make_part(cls, **{name: value})
        assert option_message(error.value).startswith(f"{flag} is {value:g}; expected ")
    if limits.get("allow_inf_nan"):
        assert getattr(make_part(cls, **{name: inf}), name) == inf
    if "ge" in limits:
        assert getattr(make_part(cls, **{name: limits["ge"]}), name) == limits["ge"]


def test_message_says_what_is_expected() -> None:
    for options, message in (
        (lambda: Outer(wide_gap=0.4), "wide_gap is 0.4; expected 0.5 s or more, and finite"),
        (lambda: Outer(wide_gap=nan), "wide_gap is nan; expected 0.5 s or more, and finite"),
        (lambda: Outer(reach=0.0), "reach is 0; expected 1 or more"),
        (lambda: Outer(count=2**64), f"count is {2**64}; expected less than {2**63}"),
        (lambda: Inner(length=0.0), "length is 0; expected more than 0 m, and finite"),
        (lambda: Inner(length=inf), "length is inf; expected more than 0 m, and finite"),
        (lambda: from_dict(Outer, {"inner": {"length": -1.0}}, "x"),
         "x: length is -1; expected more than 0 m, and finite"),
        (lambda: from_dict(Outer, {"inner": {"width": 1.0}}, "x"),
         "x: inner.width is not known; expected some of length"),
    ):  # fmt: skip
        with pytest.raises(ParameterError) as error:
            options()
        assert str(error.value) == message
    assert Outer(wide_gap=0.5, reach=inf).wide_gap == 0.5


def test_parts_are_immutable() -> None:
    with pytest.raises(AttributeError):
        Follow().stiffness = 3.0  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ParameterError, match=r"^stiffness is -1"):
        replace(Follow(), stiffness=-1.0)


@pytest.mark.parametrize("seed", [2**63, 2**64, 10**30])
def test_seed_beyond_int64_is_refused(seed: int) -> None:
    assert run_config(seed=2**63 - 1).seed == 2**63 - 1
    text = to_json(run_config()).replace('"seed": 1', f'"seed": {seed}')
    for make in (lambda: run_config(seed=seed), lambda: from_json(RunConfig, text, "c")):
        with pytest.raises(ParameterError, match=rf"seed is {seed}; expected less than {2**63}"):
            make()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"stifness": 3.0}, "--stifness is not known; there are "),
        ({"river_stiffness": 3.0}, "--river-stiffness is not known; there are "),
        ({"mode": "folow"}, "no mode 'folow'; there are follow, bunny, rivers, stretch, stretch-then-follow, lead"),
        ({"map": "cylinder"}, "no map 'cylinder'; there are cylindrical, composite, rivers, robot-arm, or give a file"),
        ({"map": "file"}, "no map 'file'; there are cylindrical, composite, rivers, robot-arm, or give a file"),
        ({"user": "lead"}, "no user 'lead'; there are relaxed, trace, push, turn"),
        ({"mode": "bunny", "tube": 0.1}, "--tube has no meaning with --mode bunny; it belongs to --mode follow, "),
        ({"bunny_width": 0.1}, "--bunny-width has no meaning with --mode follow; it belongs to --mode bunny"),
        ({"mode": "stretch", "stiffness": 1.0}, "--stiffness has no meaning with --mode stretch; it belongs to --mode"),
        ({"mode": "stretch", "governor": True}, "--governor has no meaning with --mode stretch; it belongs to --mode"),
        ({"governor_drag": 1.0}, "--governor-drag has no meaning with --mode follow; it belongs to --governor"),
        ({"wall_margin": 0.1}, "--wall-margin has no meaning with --mode follow; it belongs to --walls"),
        ({"mode": "lead", "walls": True}, "--walls has no meaning with --mode lead; it belongs to --mode follow, "),
        ({"mode": "lead", "map": "composite"}, "leave out --map composite"),
        ({"mode": "lead", "user": "push"}, "leave out --user push"),
        ({"mode": "lead", "lap": 3.0}, "--lap has no meaning with --mode lead; it belongs to maps about a circle"),
        ({"curve": "walk"}, "--curve has no meaning with --mode follow; it belongs to --map FILE.npz"),
        ({"mode": "lead", "orientation_damping": 1.0}, "it belongs to --mode follow, --mode bunny, --mode rivers"),
        ({"crossing": "wild", "mode": "rivers"}, "crossing is 'wild'; expected 'smooth', 'discrete' or 'sum'"),
        ({"stiffness": "much"}, "stiffness is 'much'; expected a number"),
        ({"seed": 1.5}, "seed is 1.5; expected a whole number"),
    ],
    ids=str,
)  # fmt: skip
def test_unknown_or_inapplicable_word_is_refused_with_its_place(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as error:
        run_config(**words)
    assert message in str(error.value)


def test_lead_mode_and_led_map_require_each_other() -> None:
    for make in (lambda: RunConfig(mode=Lead()), lambda: RunConfig(map=Led())):
        with pytest.raises(ParameterError, match="expected both, or neither"):
            make()


def _configs_of_all_kinds() -> list[RunConfig]:
    user = User(does="push", pushes=PUSHES, turns=TURNS, grabs=GRABS)
    maps = (
        Cylindrical(), Cylindrical(clips=("walk",), around=Circle(lap=2.5, radius=0.05), reach=0.02, expressive=True),
        Composite(clips=("a", "b", "c")), RiverClips(reach=0.03), MapFile(file="a/map.npz"),
        MapFile(file="map.npz", curve="walk", around=Circle(lap=3.0)),
    )  # fmt: skip
    zero = OrientationMoment()
    modes = (
        Follow(), Follow(stiffness=0.0, tube=inf, orientation=zero, governor=SpeedGovernor(), walls=JointWalls()),
        Bunny(bunny_attraction="along", orientation=OrientationMoment(orientation_stiffness=0.2)),
        Bunny(bunny_pace="clock", governor=SpeedGovernor(governor_drag=0.0)),
        Rivers(), Rivers(stiffness=40.0, crossing="sum", walls=JointWalls(joint_speed=inf)),
        Stretch(), Stretch(seek=0.0, tube_damping=3.0, walls=JointWalls(wall_margin=0.05)),
        StretchThenFollow(), StretchThenFollow(seek=70.0, bump=0.3, stiffness=200.0),
    )  # fmt: skip
    configs = [RunConfig(mode=mode, map=h_map) for mode in modes for h_map in maps]
    configs += [
        RunConfig(mode=mode, user=replace(user, does=does, grabs=() if does == "trace" else user.grabs))
        for mode in modes
        for does in ("trace", "push", "turn")
    ]
    configs += [RunConfig(mode=lead, map=Led(clips=clips), user=User(does="lead"))
             for lead, clips in ((Lead(), ("walk",)), (Lead(leash=90.0, floor_scale=70.0), ("run",)))]  # fmt: skip
    arm, by_arm = RobotArm(around=Circle(lap=3.0), reach=0.02, scale=1.2), Figure(smoothing=5.0, figure_ticks=4)
    configs += [RunConfig(mode=mode, map=arm, figure=by_arm) for mode in (Follow(), Rivers(stiffness=99.0))]
    configs.append(run_config(mode="bunny", replay="runs/mine"))
    configs.append(RunConfig(
        figure=Figure(stature=1.6, mass=60.0, smoothing=5.0, figure_ticks=4, blend=0.0), device=Phantom(cutoff=99.0),
        clock=Clock(servo_period=2e-3, physics_step=5e-4), seconds=3.0, seed=2**63 - 1,
    ))  # fmt: skip
    return configs


@pytest.mark.parametrize("config", _configs_of_all_kinds(), ids=lambda config: f"{config.mode.kind} {config.map.kind}")
def test_configuration_round_trips_through_words_and_json(config: RunConfig) -> None:
    assert run_config(**options_of(config)) == config  # pyright: ignore[reportArgumentType]
    assert from_json(RunConfig, to_json(config), "config.json") == config
    assert from_dict(RunConfig, to_dict(config), "a recording") == config
    assert from_dict(RunConfig, json.loads(json.dumps(to_dict(config))), "a recording") == config
    assert with_options(config, {}) == config


def test_round_trip_cases_cover_every_mode_and_map() -> None:
    configs = _configs_of_all_kinds()
    assert {type(config.mode) for config in configs} == set(MODES)
    assert {type(config.map) for config in configs} == {*MAPS, Led}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"stiffness"', '"stifness"', "mode.follow.stifness is not known; expected some of kind, stiffness, damping"),
        ('"lap"', '"lab"', "map.cylindrical.around.lab is not known; expected some of lap, radius"),
        ('"seconds"', '"secs"', "secs is not known; expected some of mode, map"),
        ('"follow"', '"folow"', "mode is of kind 'folow'; expected 'follow', 'bunny', "),
        ('"follow"', '"bunny"', "mode.bunny.tube is not known; expected some of kind, stiffness, damping, bunny_width"),
        ('"relaxed"', '"lazy"', "does is 'lazy'; expected 'relaxed', "),
        ("300.0", '"much"', "stiffness is 'much'; expected a number"),
        ("300.0", "-3", "stiffness is -3; expected 0 N/m or more, and finite"),
        ("0.0477", "NaN", "radius is nan; expected more than 0 m, and finite"),
        ('"phantom"', '"gloves"', "device is of kind 'gloves'; expected 'phantom', 'replay'"),
        ('"kind": "phantom"', '"kind": "replay", "run": ""', "device.replay.run is ''"),
        ("{", "", "is not JSON"),
    ],
)
def test_error_in_configuration_file_names_file_and_key(old: str, new: str, message: str, tmp_path) -> None:
    path, text = tmp_path / "my.json", to_json(run_config())
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ParameterError) as error:
        load_config(path)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)


def test_missing_configuration_file_is_named(tmp_path) -> None:
    with pytest.raises(SimError, match=r"none\.json: cannot be read \(No such file or directory\)"):
        load_config(tmp_path / "none.json")


def _options(**given: object) -> RunConfig:
    return config_of_options(RunOptions(**given))


def test_run_options_equal_words_and_keep_given_zeros() -> None:
    assert set(VOCABULARY) <= {option.name for option in fields(RunOptions)}
    assert _options() == run_config() == RunConfig()
    given: dict[str, Any] = {
        "mode": "bunny", "map": "composite", "user": "push", "seconds": 3.0, "walls": True, "expressive": True,
        "clips": ("walk", "cheer"), "wall_margin": 0.05,
    }  # fmt: skip
    assert _options(**given) == run_config(**given)
    # Zeros are kept.
    zeros: dict[str, Any] = {"stiffness": 0.0, "damping": 0.0, "seed": 0, "blend": 0.0, "orientation_stiffness": 0.0}
    config = _options(**zeros)
    assert config == run_config(**zeros)
    assert config.mode == Follow(stiffness=0.0, damping=0.0, orientation=OrientationMoment())
    assert (config.seed, config.figure.blend) == (0, 0.0)


def test_options_override_a_configuration_file(tmp_path) -> None:
    path = tmp_path / "config.json"
    config = run_config(
        "follow", "composite", "push", stiffness=200.0, lap=2.0, walls=True, wall_margin=0.05, seed=5, cutoff=90.0,
        pushes=PUSHES,
    )  # fmt: skip
    path.write_text(to_json(config), encoding="utf-8")
    assert _options(config=path) == config
    assert _options(config=path, stiffness=0.0, seed=0) == replace(
        config, mode=replace(config.mode, stiffness=0.0), seed=0
    )
    # Another mode or map has its own defaults, the rest is kept.
    assert _options(config=path, mode="bunny") == replace(config, mode=Bunny())
    assert _options(config=path, map="cylindrical") == replace(config, map=Cylindrical())
    assert _options(config=path, map="some.npz") == replace(config, map=MapFile(file="some.npz"))
    led = _options(config=path, mode="lead", clips=("run",))
    assert (led.mode, led.map, led.seed, led.device) == (Lead(), Led(clips=("run",)), 5, config.device)
    path.write_text(to_json(led), encoding="utf-8")
    assert _options(config=path, mode="follow", clips=("walk",)).map == Cylindrical(clips=("walk",))
    with pytest.raises(ParameterError, match="--tube has no meaning with --mode lead"):
        _options(config=path, tube=0.1)


@pytest.mark.parametrize(("mode", "map", "does"), [("follow", "cylindrical", "lead"), ("lead", "led", "relaxed")])
def test_leading_hand_outside_lead_mode_is_refused(mode: str, map: str, does: str) -> None:
    text = f'{{"mode": {{"kind": "{mode}"}}, "map": {{"kind": "{map}"}}, "user": {{"does": "{does}"}}}}'
    with pytest.raises(ParameterError, match="a hand leads in the mode lead only"):
        from_json(RunConfig, text, "f.json")


@pytest.mark.parametrize(
    ("does", "actions", "message"),
    [
        ("lead", {"pushes": PUSHES}, "a hand that leads follows its own path; leave out its pushes"),
        ("trace", {"person": persona("median"), "pushes": PUSHES}, "a person either pushes or has the intent 'trace'"),
        ("push", {"person": persona("median"), "pushes": PUSHES, "grabs": GRABS}, "a person either pushes or grabs"),
        ("trace", {"grabs": GRABS}, 'a hand that traces cannot grab; choose user="relaxed", push or turn'),
    ],
)
def test_contradictory_hand_actions_are_refused(does: str, actions: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        User(does=does, **actions)  # pyright: ignore[reportArgumentType]


def test_lead_without_figure_is_refused_in_a_run_and_allowed_on_a_device() -> None:
    with pytest.raises(ParameterError, match=r"^the mode lead with the figure none: nobody to lead"):
        run_config(mode="lead", figure="none")
    led = run_config(mode="lead")
    with pytest.raises(ParameterError, match="nobody to lead"):
        wire(replace(led, figure=replace(led.figure, kind="none")))
    assert session_of(served(led)).servo.argument.shape == (7,)


@pytest.mark.parametrize("mode", [cls().kind for cls in MODES])
def test_configuration_of_every_mode_round_trips_through_its_file(mode: str, tmp_path: Path) -> None:
    config = config_of_options(parse_command(["run", "--mode", mode, "--seconds", "3"]).options)
    file = tmp_path / "config.json"
    file.write_text(to_json(config))
    assert config_of_options(parse_command(["run", "--config", str(file)]).options) == config == load_config(file)
    file.write_text(to_json(config), encoding="utf-8-sig")  # with the mark that editors on Windows put in front
    assert load_config(file) == config
