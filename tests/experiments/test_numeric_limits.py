"""Excessive numbers are refused in one line, without a traceback or a long wait."""

from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.part import from_dict
from experiments.tuning.tune_config import TuneConfig
from sim.errors import SimError
from sim.users.person.population import persona, population
from tests.experiments.refused_command import refused


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("trials", "seconds = 1e15\n[factors]\nstiffness = [100, 200]",
         "toml: seconds is 1e+15; expected at most 86400 s"),
        ("tune", "seconds = 1e15\n[space]\nstiffness = {low = 1, high = 2}",
         "toml: seconds is 1e+15; expected at most 86400 s"),
        ("tune", "[space]\nstiffness = {low = inf, high = 2}", "mine.toml: low is inf; expected 0 or more, and finite"),
        ("tune", "candidates = 1000000000000\n[space]\nstiffness = {low = 1, high = 2}",
         "tuning 'mine': 1000000000000 candidates, 6 users, 1 tasks, 1 repetitions are too many; expected at most "
         "1000000 trials"),
        ("tune", "[space]\nfigure_ticks = {low = 1, high = 3}", "figure_ticks is 1.6"),
    ],
)  # fmt: skip
def test_file_with_excessive_number_is_refused_in_one_line(
    command: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f'name = "mine"\n{text}\n', encoding="utf-8")
    assert message in refused([command, str(file), "--out", str(tmp_path / "out")], capsys)
    assert not (tmp_path / "out").exists()


def test_tuning_with_too_many_trials_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    many = 10**12
    for values in ({"repetitions": many}, {"users": {"number": many}}, {"held_back": {"number": many, "seed": 3}}):
        with pytest.raises(ParameterError, match=f"{many}.* are too many; expected at most 1000000 trials"):
            from_dict(TuneConfig, {"name": "mine", "space": {"stiffness": {"low": 1, "high": 2}}} | values, "mine.toml")
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text('name = "mine"\n[space]\nstiffness = { low = 50, high = 200 }\n', encoding="utf-8")
    assert main(["tune", str(file), "--out", str(out), "--candidates", str(many)]) == 2
    message = f"tuning 'mine': {many} candidates, 6 users, 1 tasks, 1 repetitions are too many"
    assert capsys.readouterr().err == f"hvf: {message}; expected at most 1000000 trials\n"
    assert not out.exists()


def test_person_of_large_population_is_drawn_alone() -> None:
    assert persona("7:2") == population(3, 7)[2]
    assert persona("7:999999").name == "7:999999"  # in no time, where a population of a million takes minutes
    with pytest.raises(SimError, match="no person '7:1000000'"):
        persona("7:1000000")
