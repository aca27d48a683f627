"""What a newcomer meets: a mistake is one line, what is damaged or missing is named, nothing is lost unasked."""

import fcntl
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
import warnings
from argparse import Action, ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import tyro

from experiments import cli, commands
from experiments.cli import command_class, main, parsed

ROOT = Path(__file__).resolve().parents[2]
WALK = ROOT / "models" / "mocap" / "clips" / "walk.bvh"


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command says in its one line."""
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("hvf: ")
    assert captured.err.count("\n") == 1
    return captured.err


# ---- every mistake has one form


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "--seed", "9" * 23], "--seed is 99999999999999999999999; expected less than 9223372036854775808"),
        (["lift", "walk", "--seed", "9" * 23], "--seed is 99999999999999999999999; expected less than"),
        (["arm", "--seed", "9" * 23], "--seed is 99999999999999999999999; expected less than"),
        (["run", "--out", ""], "nothing is given behind --out; expected a value"),
        (["run", "--out="], "nothing is given behind --out; expected a value"),
        (["run", "--seconds", "1e12"], "--seconds is 1e+12: a recording of 4e+05 TB or more, and "),
        (["run", "--seconds", "1e12", "--user", "push"], "--seconds is 1e+12: a recording of"),
        (["arm", "--seconds", "1e12"], "--seconds is 1e+12: a recording of"),
        (["run", "--mode", "stretch", "--lap", "0.01"], "--lap is 0.01; expected 0.1 s or more"),
        (["run", "--stiffness", "abc"], "--stiffness is 'abc'; expected a number; hvf run --help"),
        (["run", "--seed", "1.5"], "--seed is '1.5'; expected a whole number; hvf run --help"),
        (["run", "--crossing", "sideways"], "--crossing is 'sideways'; expected discrete, smooth, sum; hvf run"),
        (["run", "--mode"], "nothing is given behind --mode; expected a value; hvf run --help"),
        (["run", "--clips"], "nothing is given behind --clips; expected one or more names"),
        (["live", "--clips", "--mode", "lead"], "nothing is given behind --clips; expected one or more names"),
        (["live", "--clips", "nope.bvh"], "nope.bvh: cannot be opened (No such file or directory)"),
        (["live", "--map", "nope.npz"], "nope.npz: cannot be read (No such file or directory)"),
        (["run", "--bogus", "1"], "unrecognized options: --bogus, 1; hvf run --help"),
        (["certify", "--no-no-hand"], "unrecognized options: --no-no-hand"),
        (["run", "--no-governor"], "unrecognized options: --no-governor"),
        (["bogus"], "hvf COMMAND --help lists what there is"),
        (["hardware"], "expected one of {list, doctor, run, "),
        (
            ["convert"],
            "missing from hvf convert: PATH (Motion file to read), PATH (File to write: .bvh, or .glb for glTF)",
        ),
        (
            ["picture", "run", "--fine", "run.png"],
            "missing from hvf picture: PATH, or an option is mistyped; hvf picture",
        ),
        (["live", "--port", "99999999"], "--port is 99999999; expected less than 65536"),
        (["convert", "nowhere.bvh", "x.bvh"], "hvf: nowhere.bvh: cannot be opened (No such file or directory)"),
        (["convert", "walk.bvh", "x.fbx"], "only BVH and glTF can be written; expected a name that ends in .bvh, .glb"),
        (["track", "nowhere.bvh"], "hvf: nowhere.bvh: cannot be opened (No such file or directory)"),
        (["run", "--clips", "nowhere.amc"], "hvf: nowhere.amc: cannot be opened (No such file or directory)"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refused(arguments, capsys)
    assert not list(tmp_path.iterdir())


def test_a_bend_that_a_lap_is_too_short_for_names_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", "--mode", "stretch", "--lap", "0.8", "--figure", "none", "--out", str(tmp_path / "run")]
    assert "expected --lap 1.1 or more, or --bump 0.39 or less" in refused(command, capsys)


def test_a_motion_in_a_file_of_another_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(WALK, tmp_path / "walk.fbx")
    said = refused(["convert", str(tmp_path / "walk.fbx"), str(tmp_path / "out.bvh")], capsys)
    assert "walk.fbx: .fbx files are not read; expected BVH, AMC (with its ASF beside it) or DeepMimic JSON" in said


@pytest.mark.parametrize("content", ["noise", "pickled", "text"])
def test_a_file_that_is_no_map_is_refused_without_advice_to_unpickle(
    content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "map.npz"
    if content == "pickled":
        np.savez(path, version=np.array([1, None], dtype=object), kind="Lifted", keys=[])
    else:
        path.write_bytes(random.Random(1).randbytes(3000) if content == "noise" else b"hello")
    said = refused(["run", "--map", str(path), "--out", str(tmp_path / "run")], capsys)
    assert said.endswith("is no file of a map, or damaged; expected what hvf lift writes\n")
    assert "pickle" not in said


# ---- the options


def _parsers(parser: ArgumentParser, name: str) -> Iterator[tuple[str, Action]]:
    """Every option of every command, as the parser has it."""
    for action in parser._actions:
        if hasattr(action, "_name_parser_map"):
            for sub, below in action.choices.items():  # pyright: ignore
                yield from _parsers(below, f"{name} {sub}")
        elif action.dest != "help":
            yield name, action


def options() -> list[tuple[str, Action]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tyro's way to look at a parser is to be replaced by another
        parser = tyro.extras.get_parser(cli.choice_of(commands.NAMES), config=cli._STYLE)
    return list(_parsers(parser, "hvf"))


OPTIONS = options()


def test_every_option_of_every_command_says_what_it_is_and_in_what_unit() -> None:
    assert len(OPTIONS) > 300
    for command, action in OPTIONS:
        said = str(action.help or "").split("(default")[0].strip()
        assert len(said) > 3, (command, action.option_strings)
        assert "pyright" not in said
        assert "None" not in (action.metavar or "")
        if "FLOAT" in str(action.metavar):
            assert re.search(r"\[[^\]]+\]", said), (command, action.option_strings, said)


def test_no_switch_is_denied_twice() -> None:
    switches = [string for _, action in OPTIONS for string in action.option_strings]
    assert not [string for string in switches if string.startswith("--no-no-")]
    assert "--no-hand" in switches
    assert "--no-dead-man" in switches  # of what is on by default


def test_every_command_has_a_file_of_its_name_and_figures_as_json() -> None:
    files = {path.stem for path in (ROOT / "experiments" / "commands").glob("*.py")} - {"__init__"}
    assert files == set(commands.NAMES)
    with_json = {command for command, action in OPTIONS if "--json" in action.option_strings}
    silent = {"live", "picture", "render", "figures", "bench"}  # draw, or are watched
    hardware = {f"hardware {name}" for name in ("list", "doctor", "run", "calibrate", "identify")}
    for name in (set(commands.NAMES) | hardware) - silent - {"hardware"}:
        assert f"hvf {name}" in with_json


# ---- two hundred command lines


VALUES = (
    "0", "1", "-1", "0.5", "1e-9", "1e12", "1e308", "nan", "inf", "-inf", "9" * 23, "abc", "", " ", "walk", "cheer",
    "/", "/dev/null", ".", "--", "None", "true", "0.1 0.2", "é", "median", "1:2", "../..", "*", "x.npz", "x.bvh",
)  # fmt: skip


def _words(chance: random.Random, command: str, n: int) -> list[str]:
    known = [action for name, action in OPTIONS if name == f"hvf {command}" and action.option_strings]
    words: list[str] = []
    for action in chance.sample(known, min(n, len(known))):
        words.append(action.option_strings[0])
        if action.nargs != 0:
            many = 2 if "FLOAT FLOAT" in str(action.metavar) else 1
            choices = re.findall(r"[\w-]+", str(action.metavar)) if "{" in str(action.metavar) else []
            likely = [*choices, *(("0.5", "1", "2", "20") if chance.random() < 0.5 else ())]
            words += [chance.choice(likely or VALUES) for _ in range(many)]
    return words


@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize(
    ("seed", "lines"), [(0, 40), *(pytest.param(seed, 60, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_no_command_line_ends_in_a_traceback(
    seed: int, lines: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Random options with random values: what runs is of one tick, without a figure and a page."""
    monkeypatch.chdir(tmp_path)
    for name in ("convert", "prepare", "repair", "track", "lift", "trials", "tune", "live", "certify", "arm"):
        monkeypatch.setattr(command_class(name), "__call__", lambda self: 0)  # what is typed is read, and no more
    chance = random.Random(seed)
    ran = 0
    for k in range(lines):
        if k % 5:
            name, words = "run", ["--figure", "none", "--seconds", "0.02", *_words(chance, "run", chance.randint(1, 2))]
        else:
            name = chance.choice(["convert", "prepare", "track", "certify", "lift", "arm", "trials", "tune", "live"])
            words = _words(chance, name, chance.randint(0, 4))
        if "--view" in words:
            continue
        try:
            code = main([name, *words])
        except SystemExit as ended:
            code = ended.code
        captured = capsys.readouterr()
        line = " ".join([name, *words])
        assert code in (0, 2), f"{line}\n{captured.err}"
        assert "Traceback" not in captured.err, line
        if code == 2:
            assert [said for said in captured.err.splitlines() if said.startswith("hvf: ")], line
        ran += code == 0
        shutil.rmtree(tmp_path / "runs", ignore_errors=True)
    assert ran >= 0.05 * lines  # some do: 3 of 60 with seed 1, 7 or more with the others


# ---- runs that are damaged, stopped, or two at a time


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "run"
    assert main(["run", "--figure", "none", "--seconds", "1", "--out", str(out)]) == 0
    return out


READERS = (["report"], ["reproduce"], ["certify"], ["render"], ["picture"])


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader[0])
def test_a_recording_that_is_cut_short_is_refused_at_once(
    reader: list[str], run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoiled = tmp_path / "run"
    shutil.copytree(run, spoiled)
    (spoiled / "run.h5").write_bytes((run / "run.h5").read_bytes()[:200_000])
    target = [str(tmp_path / "x.png")] if reader == ["picture"] else []
    began = time.perf_counter()
    said = refused([*reader, str(spoiled), *target], capsys)
    assert time.perf_counter() - began < 20.0
    assert "run.h5: not a recording, cut short: 200000 bytes of " in said


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader[0])
def test_a_recording_that_lacks_rows_is_refused_with_the_channel(
    reader: list[str], run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoiled = tmp_path / "run"
    shutil.copytree(run, spoiled)
    with h5py.File(spoiled / "run.h5", "r+") as file:
        file["ticks/force"].resize(100, axis=0)
    target = [str(tmp_path / "x.png")] if reader == ["picture"] else []
    said = refused([*reader, str(spoiled), *target], capsys)
    assert "run.h5: not a recording, or damaged (ticks/force has 100 rows, ticks/rows says 1000)" in said


@pytest.mark.parametrize(
    ("lacks", "told"),
    [("static/curve", "no array or text curve; there are"), ("ticks/p", "no channel ticks/p; there are")],
)
def test_what_a_recording_lacks_is_named(
    lacks: str, told: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoiled = tmp_path / "run"
    shutil.copytree(run, spoiled)
    with h5py.File(spoiled / "run.h5", "r+") as file:
        del file[lacks]
    assert f"run.h5: {told}" in refused(["report", str(spoiled)], capsys)


def test_a_recording_that_lacks_frames_is_not_the_same(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoiled = tmp_path / "run"
    shutil.copytree(run, spoiled)
    with h5py.File(spoiled / "run.h5", "r+") as file:
        for name in ("t", "qpos"):
            file["frames"][name].resize(100, axis=0)
        file["frames/rows"][0] = 100
    assert "run.h5: damaged: it has 100 frames; expected 500 for 1000 ticks" in refused(
        ["reproduce", str(spoiled)], capsys
    )


def test_two_runs_do_not_write_into_one_folder(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    descriptor = os.open(run, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # as a run of another process has it
        command = ["run", "--figure", "none", "--seconds", "1", "--out", str(run), "--overwrite"]
        assert "another run is being written into it" in refused(command, capsys)
        assert (run / "run.h5").exists()
    finally:
        os.close(descriptor)  # as a process that crashes lets go of it
    assert main(command) == 0


def test_a_run_of_a_day_says_first_what_it_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.console import estimates
    from sim.recording.recorder import Group

    monkeypatch.setattr(estimates, "expected_seconds", lambda what: 0.25)
    groups = {"ticks": Group(1000.0, {"x": (100,)})}
    said = estimates.foreseen(tmp_path, 86400.0 / 24, groups)
    assert said is not None
    assert said.startswith("3600 s of simulated time take about 15 minutes at the pace of the last run, and 2.88 GB of")
    assert estimates.foreseen(tmp_path, 10.0, groups) is None


def test_a_certificate_of_something_else_is_not_replaced_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--clip", "walk", "--out", "here"]) == 0
    before = Path("here/certificate.json").read_bytes()
    said = refused(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here"], capsys)
    assert said == "hvf: here: holds a certificate of something else; choose another --out, or --overwrite it\n"
    assert Path("here/certificate.json").read_bytes() == before
    assert main(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here", "--overwrite"]) == 0
    assert Path("here/certificate.json").read_bytes() != before


def test_a_certificate_is_verified_with_what_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--clip", "walk", "--friction", "0.5", "--out", "here"]) == 0
    assert main(["certify", "--verify", "here/certificate.json"]) == 0
    assert "all that it is of is as it was" in capsys.readouterr().out
    assert main(["certify", "--clip", "walk", "--verify", "here/certificate.json"]) == 1
    assert "changed: judging" in capsys.readouterr().err


@pytest.mark.slow
def test_a_certificate_of_gains_is_verified_with_these_gains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["certify", "--stiffness", "500", "--no-hand", "--out", "field"]) == 0
    assert main(["certify", "--verify", "field/certificate.json"]) == 0
    assert main(["certify", "--stiffness", "400", "--no-hand", "--verify", "field/certificate.json"]) == 1
    assert "changed: gains" in capsys.readouterr().err


def _drawn(out: Path, picture: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "DISPLAY")}
    command = [sys.executable, "-m", "experiments.cli", "picture", str(out), str(picture)]
    return subprocess.run(
        command, env=kept | {"PYTHONPATH": str(ROOT)} | environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("backend", [None, "glfw", "bogus"])
def test_a_picture_is_drawn_without_a_display_and_whatever_mujoco_gl_says(
    backend: str | None, run: Path, tmp_path: Path
) -> None:
    picture = tmp_path / "x.png"  # an existing one is left as it is
    done = _drawn(run, picture) if backend is None else _drawn(run, picture, MUJOCO_GL=backend)
    assert "Traceback" not in done.stderr
    if done.returncode == 2:  # a machine without EGL and OSMesa
        assert "expected EGL or OSMesa: apt-get install" in done.stderr
        pytest.skip("nothing can be drawn on this machine")
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000


def _json(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_figures_are_printed_as_json(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    out = str(tmp_path / "run")
    ran = _json(["run", "--figure", "none", "--seconds", "0.5", "--out", out], capsys)
    assert ran["path"]["laps"] > 0.1
    assert ran == json.loads(Path(out, "summary.json").read_text())
    assert _json(["reproduce", str(run)], capsys)["same"] is True
    assert _json(["convert", str(WALK), str(tmp_path / "walk.bvh")], capsys)["lines"]
    assert {clip["name"] for clip in _json(["clips"], capsys)} >= {"walk", "run"}


@pytest.mark.slow
def test_figures_of_slow_commands_are_printed_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert _json(["track", "walk", "--seconds", "0.5"], capsys)["walk"]["root_error"] < 0.1
    assert _json(["arm", "--seconds", "1.5", "--user", "relaxed", "--out", str(tmp_path / "arm")], capsys)["lines"]
    assert _json(["prepare", str(WALK), str(tmp_path / "p.bvh")], capsys)["well_formed"]
    assert _json(["certify", "--clip", "walk", "--out", str(tmp_path / "c")], capsys)["ballistic"]["verdict"]


def test_what_was_chosen_by_default_is_in_the_resolved_configuration(run: Path, tmp_path: Path) -> None:
    """Pushes and grabs of a hand that none were given for; a run of that file has them again."""
    from experiments.config.run_config import load_config
    from experiments.setups.parts.defaults import resolved

    out = tmp_path / "pushed"
    assert main(["run", "--figure", "none", "--user", "push", "--lap", "0.5", "--seconds", "1", "--out", str(out)]) == 0
    config = load_config(out / "config.json")
    assert config.user.pushes
    assert resolved(config) == config
    assert parsed(["run", "--config", str(out / "config.json")])
