"""The options of all commands: help texts, names, JSON output, and random command lines."""

import random
import re
import shutil
import warnings
from argparse import Action, ArgumentParser
from collections.abc import Iterator
from pathlib import Path

import pytest
import tyro

from experiments import cli, commands
from experiments.cli import command_class, main

ROOT = Path(__file__).resolve().parents[2]


def _options_below(parser: ArgumentParser, name: str) -> Iterator[tuple[str, Action]]:
    """Options of a parser and its subcommands, with the name of their command."""
    for action in parser._actions:
        if hasattr(action, "_name_parser_map"):
            for sub, below in action.choices.items():  # pyright: ignore
                yield from _options_below(below, f"{name} {sub}")
        elif action.dest != "help":
            yield name, action


def options() -> list[tuple[str, Action]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tyro's way to look at a parser is to be replaced by another
        parser = tyro.extras.get_parser(cli.command_union(commands.NAMES), config=cli._STYLE)
    return list(_options_below(parser, "hvf"))


OPTIONS = options()


def test_every_option_has_help_text_and_unit() -> None:
    assert len(OPTIONS) > 300
    for command, action in OPTIONS:
        description = str(action.help or "").split("(default")[0].strip()
        assert len(description.split()) >= 3, (command, action.option_strings, description)
        assert "pyright" not in description
        assert "None" not in (action.metavar or "")
        if "FLOAT" in str(action.metavar):
            assert re.search(r"\[[^\]]+\]", description), (command, action.option_strings, description)


def test_no_switch_has_a_double_negation() -> None:
    switches = [string for _, action in OPTIONS for string in action.option_strings]
    assert not [string for string in switches if string.startswith("--no-no-")]
    assert "--no-hand" in switches
    assert "--no-dead-man" in switches  # negation of a switch that is on by default


def test_every_command_has_its_file_and_json_output() -> None:
    files = {path.stem for path in (ROOT / "experiments" / "commands").glob("*.py")} - {"__init__"}
    assert files == set(commands.NAMES)
    with_json = {command for command, action in OPTIONS if "--json" in action.option_strings}
    without_json = {"live", "picture", "render", "figures", "bench"}  # their result is a picture, page or table
    hardware = {f"hardware {name}" for name in ("list", "doctor", "run", "calibrate", "identify")}
    for name in (set(commands.NAMES) | hardware) - without_json - {"hardware"}:
        assert f"hvf {name}" in with_json


VALUES = (
    "0", "1", "-1", "0.5", "1e-9", "1e12", "1e308", "nan", "inf", "-inf", "9" * 23, "abc", "", " ", "walk", "cheer",
    "/", "/dev/null", ".", "--", "None", "true", "0.1 0.2", "é", "median", "1:2", "../..", "*", "x.npz", "x.bvh",
)  # fmt: skip


def _random_options(rng: random.Random, command: str, n: int) -> list[str]:
    known = [action for name, action in OPTIONS if name == f"hvf {command}" and action.option_strings]
    arguments: list[str] = []
    for action in rng.sample(known, min(n, len(known))):
        arguments.append(action.option_strings[0])
        if action.nargs != 0:
            count = 2 if "FLOAT FLOAT" in str(action.metavar) else 1
            choices = re.findall(r"[\w-]+", str(action.metavar)) if "{" in str(action.metavar) else []
            likely = [*choices, *(("0.5", "1", "2", "20") if rng.random() < 0.5 else ())]
            arguments += [rng.choice(likely or VALUES) for _ in range(count)]
    return arguments


@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize(
    ("seed", "lines"), [(0, 40), *(pytest.param(seed, 60, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_random_command_line_runs_or_is_refused_in_one_line(
    seed: int, lines: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Random options with random values; runs last 20 ms, without a figure and a page."""
    monkeypatch.chdir(tmp_path)
    for name in ("convert", "prepare", "repair", "track", "lift", "trials", "tune", "live", "certify"):
        monkeypatch.setattr(command_class(name), "__call__", lambda self: 0)  # arguments are parsed, nothing is run
    rng = random.Random(seed)
    accepted = 0
    for k in range(lines):
        if k % 5:
            name, words = (
                "run",
                ["--figure", "none", "--seconds", "0.02", *_random_options(rng, "run", rng.randint(1, 2))],
            )
        else:
            name = rng.choice(["convert", "prepare", "track", "certify", "lift", "trials", "tune", "live"])
            words = _random_options(rng, name, rng.randint(0, 4))
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
            assert captured.err.startswith("hvf: "), f"{line}\n{captured.err}"
            assert captured.err.count("\n") == 1, f"{line}\n{captured.err}"
        accepted += code == 0
        shutil.rmtree(tmp_path / "runs", ignore_errors=True)
    assert accepted >= 0.05 * lines  # 3 of 60 with seed 1, 7 or more with the others
