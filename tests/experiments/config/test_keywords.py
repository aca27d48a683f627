"""Messages from Python say what is expected, and name keywords where those of the command line name options."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hvf
from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.keywords import option_message, to_keywords, with_keyword_messages
from experiments.config.options import run_config
from models.mocap.readers.own_bvh import write_bvh

CURVE, CHEER = hvf.circle(), hvf.clips("cheer")[0]
SIM = hvf.Simulation(
    field=hvf.Follow(CURVE, k_r=300, b_d=8), haptic_map=hvf.Cylindrical([CHEER], around=CURVE),
    figure=hvf.Figure(kind="none"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("--wall-margin is 3 rad", "wall_margin is 3 rad"),
        ("expected --lap 1.1 or more, or --bump 0.24.", "expected lap=1.1 or more, or bump=0.24."),
        ("--residual-force 1e-05 has no meaning", "residual_force=1e-05 has no meaning"),
        ("leave out --user push; with --figure none", 'leave out user="push"; with figure="none"'),
        ("--map FILE.npz, --mode follow, --governor", 'map FILE.npz, mode="follow", governor'),
        ("choose another --out, or --overwrite it", "choose another record, or overwrite it"),
        ("as `hvf run --help` has them, or --threads", "as `hvf run --help` has them, or threads"),
        ("a smaller --room.r-range or another --room.z-range", "a smaller room.r_range or another room.z_range"),
        ("add a person, such as --person median", 'add a person, such as person="median"'),
        ("a hand -- and a file a--b-c.bvh", "a hand -- and a file a--b-c.bvh"),
        ("0.4 m --> 0.5 m", "0.4 m --> 0.5 m"),
    ],
)
def test_option_in_message_becomes_keyword(text: str, message: str) -> None:
    assert to_keywords(text, out="record") == message


def test_error_type_and_traceback_are_preserved() -> None:
    @with_keyword_messages()
    def fails() -> None:
        raise ParameterError("--lap is 0; expected more")

    with pytest.raises(ParameterError, match=r"^lap is 0; expected more$") as raised:
        fails()
    assert raised.traceback[-1].name == "fails"


def test_nested_conversion_to_options_restores_the_message() -> None:
    @with_keyword_messages()
    def fails() -> None:
        raise ParameterError("--lap is 0 with --figure none")

    with pytest.raises(ParameterError, match=r'^lap is 0 with figure="none"$') as raised:
        with_keyword_messages(figure="kind")(fails)()
    assert option_message(raised.value) == "--lap is 0 with --figure none"
    assert option_message(ParameterError("--lap is 0")) == "--lap is 0"


SPACE, CERTIFIED = {"field.k_r": (50.0, 90.0)}, SimpleNamespace(verdict="certified")
NAN, DESIGN = float("nan"), {"name": "s", "factors": {"stiffness": [100.0, 300.0]}}


PUSH = hvf.Push(0.0, 1.0, 1.0)


def person_session(**does: Any) -> Any:
    return replace(SIM, user=hvf.User(person=hvf.Person(), **does)).session(1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hvf.Figure(stature=-1.0), "stature is -1; expected more than 0 m, and finite"),
        (lambda: hvf.Figure(kind="ghost"), "kind is 'ghost'; expected 'physical', 'kinematic' or 'none'"),  # pyright: ignore
        (lambda: hvf.Figure(kind="none", smoothing=3.0), 'smoothing=3 has no meaning with kind="none"; it belongs to '),
        (lambda: hvf.Figure(stature=None), "stature is None; expected a number"),  # pyright: ignore
        (lambda: hvf.Figure("none"), "Figure is given 'none' without a name; expected some of kind=, stature=, mass="),  # pyright: ignore
        (lambda: hvf.Phantom(150.0), "Phantom is given 150.0 without a name; expected some of kind=, cutoff="),  # pyright: ignore
        (lambda: hvf.Phantom(cutoff=NAN), "cutoff is nan; expected more than 0 Hz, and finite"),
        (lambda: hvf.Phantom(device_file=3), "device_file is 3; expected text"),  # pyright: ignore
        (lambda: hvf.Clock(servo_period=0.0), "servo_period is 0; expected more than 0 s, and finite"),
        (lambda: hvf.Clock(servo_period=0.02), "servo_period is 0.02; expected at most 0.01 s"),
        (lambda: hvf.Replay(""), "run is ''; expected text that is not empty"),
        (lambda: hvf.Replay(3), "run is 3; expected text"),  # pyright: ignore
        (lambda: list(hvf.sweep(SIM, {"clock.physics_step": [-1.0]})), "physics_step is -1; expected more than 0 s"),
        (lambda: hvf.certify(replace(SIM, device=hvf.Replay("x"))), "expected a Phantom: leave out replay"),
        (lambda: hvf.Study.of(**DESIGN, seed=-1), "study: seed is -1; expected 0 or more"),
        (lambda: hvf.Study.of(**DESIGN, users=3), "study: users is 3; expected values by name, or Users"),
        (lambda: hvf.Study.of(**DESIGN).with_users(0), "number is 0; expected 1 or more"),
        (lambda: hvf.Study.of(**DESIGN, run={"lap": -1}).trials, "condition stiffness = 100.0: lap is -1; expected "),
        (lambda: hvf.Study.of(**DESIGN).run("x", threads=0), "threads is 0; expected 1 or more"),
        (lambda: hvf.Study.of(**DESIGN).run("x", threads=1, workers=1), "threads and workers contradict each other"),
        (lambda: hvf.Study.of(**DESIGN).run(""), "out is empty; expected a path"),
        (lambda: hvf.Study.of(**DESIGN).run("x", console=3), "console is 3; expected Console or None"),  # pyright: ignore
        (lambda: hvf.Study.load(""), "path is empty; expected a path"),
        (lambda: hvf.lift("walk", "a.npz"), "names is 'walk'; expected a sequence, each text or Path"),
        (lambda: hvf.lift(["walk", "run"], ""), "out is empty; expected a path"),
        (lambda: hvf.lift(["walk", "run"], "a.npz", overwrite="no"), "overwrite is 'no'; expected True or False"),  # pyright: ignore
        (lambda: hvf.lift(["walk", "run"], "a.npz", seed=True), "seed is True; expected a whole number"),
        (lambda: hvf.lift(["walk", "run"], "a.npz", room=hvf.Room((0.2, 0.4))), "a smaller room.r_range or another"),
        (lambda: hvf.Room("x"), "r_range is 'x'; expected 2 numbers"),  # pyright: ignore
        (lambda: hvf.prepare("", "a.bvh"), "source is empty; expected a path"),
        (lambda: hvf.prepare("a.bvh", "b.bvh", overwrite=1), "overwrite is 1; expected True or False"),
        (lambda: hvf.load(""), "path is empty; expected a path"),
        (lambda: hvf.run(orientation=True), "orientation is not known; there are "),
        (lambda: hvf.run(user="cut"), 'add a person, such as person="median"'),
        (lambda: hvf.run(clips="walk"), "clips is 'walk'; expected a list"),
        (lambda: hvf.run(clips=[3]), "clips"),  # pyright: ignore
        (lambda: hvf.run(config=3), "config is 3"),  # pyright: ignore
        (lambda: hvf.run(record=3), "record is 3"),  # pyright: ignore
        (lambda: hvf.run(seed=1.5), "seed is 1.5; expected a whole number"),
        (lambda: hvf.run(out="x"), "out is an option of the command line; expected record, a folder to write into"),
        (lambda: hvf.run(overwrite="no"), "overwrite is 'no'; expected True or False"),
        (lambda: hvf.run(config=""), "config is empty; expected a path"),
        (lambda: SIM.run(1.0, overwrite="no"), "overwrite is 'no'; expected True or False"),  # pyright: ignore
        (lambda: hvf.Lifted(""), "file is empty; expected a path"),
        (lambda: hvf.sweep(SIM, {"field.nothing": [1]}), "field.nothing: Follow has no 'nothing'; expected some of "),
        (lambda: hvf.sweep(SIM, {"field.k_r": [200, -1]}), "k_r must be finite and at least 0 N/m, got -1"),
        (lambda: hvf.sweep(SIM, {3: [1]}), "a path of values is 3; expected text"),  # pyright: ignore
        (lambda: hvf.sweep(SIM, {"seed": [1]}, seconds=NAN), "a run of nan s; expected 0.004 s or more, and finite"),
        (lambda: person_session(intent=hvf.intents.Trace(), pushes=[PUSH]), "expected an intent or pushes, not both"),
        (lambda: hvf.Search(journal=""), "journal is empty; expected a path"),
        (lambda: hvf.tune(SIM, SPACE, lambda: 1.0), "cost is <lambda>(); expected a function of a run"),  # pyright: ignore
        (lambda: hvf.tune(SIM, {"field.k_r": (-5.0, 90.0)}, len), "k_r must be finite and at least 0 N/m, got -5"),  # pyright: ignore
        (lambda: hvf.tune(SIM, {3: (50.0, 90.0)}, len), "a path of the space is 3; expected text"),  # pyright: ignore
        (lambda: hvf.tune(SIM, SPACE, len, seconds=None), "seconds is None; expected a number"),  # pyright: ignore
        (lambda: hvf.certify(3), "sim is 3; expected Simulation"),  # pyright: ignore
        (lambda: hvf.certify(SIM, delay="1"), "delay is '1'; expected a number"),  # pyright: ignore
        (lambda: hvf.certify(SIM, delay=-1.0), "delay must be finite and at least 0 s, got -1.0"),
        (lambda: hvf.certify(SIM, delay=3.0), "the delay of a loop must be at most 128 periods of 0.001 s, got 3.0 s"),
        (lambda: hvf.load(None), "path is None; expected text or Path"),  # pyright: ignore
        (lambda: hvf.clips("walk", 3), "name is 3; expected text or Path"),  # pyright: ignore
        (lambda: hvf.Person(hand=np.ones(2)), "hand is array([1., 1.]); expected text"),  # pyright: ignore
        (lambda: hvf.Push(10**400, 1.0, 1.0), "expected a number"),
        (lambda: hvf.Study.load(3), "path is 3; expected text or Path"),  # pyright: ignore
        (lambda: hvf.law(3), "a law is made from a function law(hand, …); got 3"),  # pyright: ignore
        (lambda: hvf.rest_pose("tall"), "stature is 'tall'; expected more than 0 m, and finite"),  # pyright: ignore
        (lambda: hvf.Cylindrical(CHEER, around=CURVE), "expected a sequence, each Clip"),  # pyright: ignore
        (lambda: hvf.Composite([CHEER], around=CURVE, reach=-0.1), "reach is -0.1; expected more than 0 m, and finite"),
        (lambda: hvf.User(intent=hvf.intents.Trace), "expected PersonIntent or None"),  # pyright: ignore
        (lambda: hvf.Simulation(field=SIM.field, haptic_map=hvf.Cylindrical), "haptic_map is "),  # pyright: ignore
        (lambda: replace(SIM, field=lambda hand: (0, 0, 0)), "; expected a law of force, "),
        (lambda: replace(SIM, haptic_map=CHEER), "haptic_map is <clip 'cheer'"),
        (lambda: replace(SIM, figure="none"), "figure is 'none'; expected hvf.Figure"),
        (lambda: replace(SIM, user=None), "user is None"),
        (lambda: replace(SIM, seed=1.5), "seed is 1.5; expected a whole number"),
        (lambda: replace(SIM, seed=-1), "seed is -1"),
        (lambda: SIM.run(0.001), "expected 0.004 s or more"),
        (lambda: SIM.run(1e300), "expected less than"),
        (lambda: SIM.run("3"), "seconds is '3'; expected a number"),  # pyright: ignore
        (lambda: SIM.run(3.0, record=3), "record is 3; expected text or Path"),  # pyright: ignore
        (lambda: SIM.run(3.0, record="a\0b"), "record is 'a\\x00b'; expected a path without a null character"),
        (lambda: SIM.session(-1.0), "seconds is -1; expected more than 0 s, and finite"),
        (lambda: SIM.session(float("inf")), "seconds is inf; expected more than 0 s, and finite"),
        (lambda: hvf.sweep(SIM, {"field.k_r": 300}), "field.k_r is 300; expected a sequence"),  # pyright: ignore
        (lambda: hvf.sweep(SIM, {"field.k_r": []}), "field.k_r has no values; expected one or more"),
        (lambda: hvf.tune(3, SPACE, len), "sim is 3; expected Simulation"),  # pyright: ignore
        (lambda: hvf.tune(SIM, SPACE, 3), "cost is 3; expected a function of a run"),  # pyright: ignore
        (lambda: hvf.tune(SIM, {"field.k_r": ("a", "b")}, len), "expected a sequence, each a number"),  # pyright: ignore
        (lambda: hvf.tune(SIM, SPACE, len, panel=(3,)), "expected a sequence, each User"),  # pyright: ignore
        (lambda: np.ones(2) * SIM.field, "s is array([1., 1.]); expected a number"),
        (lambda: hvf.circle(lap=1e10), "lap is 1e+10; expected at most 86400 s"),
        (lambda: hvf.Search(candidates=10**12), "candidates is 1000000000000; expected 1 to 1000000"),
        (lambda: hvf.Search(candidates=0), "candidates is 0; expected 1 to 1000000"),
        (lambda: hvf.Search(sampler="best"), "sampler is 'best'; expected one of tpe, cma-es, nsga-ii, random"),  # pyright: ignore
        (lambda: hvf.Clip(CHEER.poses, "30", "mine"), "30 frames per second; expected a positive number"),  # pyright: ignore
        (lambda: hvf.Clip(np.array([["1"] * 75]), 30.0, "mine"), "poses are no array of numbers"),
    ],
)  # fmt: skip
def test_messages_of_public_interface_name_keywords(
    make: Callable[[], Any], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(hvf.HvfError) as error:
        make()
    assert message in str(error.value)
    assert "--" not in str(error.value)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["x", True, None, NAN, (1.0, 2.0)])
def test_non_numeric_cost_is_refused_with_its_values(wrong: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.tuning.tune.certify", lambda sim: SimpleNamespace(stability=CERTIFIED))
    message = rf"^the cost at \{{'field\.k_r': \d.*\}} is {re.escape(repr(wrong))}; expected 1 finite number"
    with pytest.raises(hvf.ParameterError, match=message):
        hvf.tune(SIM, SPACE, lambda run: wrong, seconds=0.1, search=hvf.Search(candidates=1))


def test_messages_use_keywords_in_python_and_options_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.h5").write_bytes(b"precious")
    words = {"figure": "none", "seconds": 1.0}
    for begin in (lambda: SIM.run(1.0, record=tmp_path), lambda: hvf.run(record=tmp_path, **words)):
        with pytest.raises(hvf.SimError, match=r"holds a run; choose another record, or overwrite it$"):
            begin()
    assert main(["run", "--figure", "none", "--seconds", "1", "--out", str(tmp_path)]) == 2
    assert "choose another --out, or --overwrite it" in capsys.readouterr().err
    for keyword_arguments, message in (
        ({"foo": 3}, "^foo is not known; there are "),
        ({"figure": "none", "smoothing": 6.0}, '^smoothing=6.0 has no meaning with figure="none"; it belongs'),
        ({"mode": "lead", "clips": ["walk", "run"]}, "^got 2 clips; expected one to lead, such as walk or run$"),
        ({"stiffness": -1.0}, "^stiffness is -1; expected 0 N/m or more"),
    ):
        with pytest.raises(hvf.ParameterError, match=message):
            hvf.run(**keyword_arguments)
    with pytest.raises(hvf.ParameterError, match=r"^--foo is not known; there are "):
        run_config(foo=3)
    with pytest.raises(hvf.ParameterError, match=r"^got 0 clips; expected 1 to 4 for the cylindrical map$"):
        hvf.Cylindrical([], around=CURVE)


def test_run_remarks_name_keywords() -> None:
    turns = hvf.run(user="turn", figure="none", seconds=0.1)
    assert any(remark.endswith("this map ignores its orientation; use expressive") for remark in turns.remarks)
    assert "--" not in str(turns)


def test_warning_of_infeasible_capture_names_keywords(monkeypatch: pytest.MonkeyPatch) -> None:
    class Found:
        feasible, remarks, clip = False, ("not feasible; --raw takes the capture as it is",), SIM

    monkeypatch.setattr("experiments.public.prepared_clips", lambda *given: (Found(),))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hvf.load("mine.bvh")
    assert [str(one.message) for one in caught] == ["not feasible; raw takes the capture as it is"]
    assert caught[0].filename == __file__


def test_clips_are_names_or_files(tmp_path: Path) -> None:
    path = tmp_path / "mine.bvh"
    write_bvh(hvf.clips("walk")[0], path)
    walk, mine = hvf.clips("walk", path)
    np.testing.assert_allclose(mine.poses, walk.poses, atol=1e-4)
    assert (mine.name, len(hvf.clips())) == ("mine", 9)
    with pytest.raises(hvf.HvfError, match="no embedded clip 'wlak'; there are "):
        hvf.clips("wlak")
