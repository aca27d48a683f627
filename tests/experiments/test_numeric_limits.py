"""Excessive numbers are refused in one line, without a traceback or a long wait."""

from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.part import from_dict
from experiments.tuning.tune_config import TuneConfig
from sim.errors import SimError
from sim.users.person.population import persona, population


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("certify --hand.stiffness 0 1e300", "stiffness of a hand must be at most 1e+06, got 1e+300"),
        ("certify --hand.mass 0 1e9", "mass of a hand must be at most 1000, got 1e+09"),
        ("certify --delay 3", "the delay of a loop must be at most 128 periods of 0.001 s, got 3.0 s"),
        ("run --mode lead --floor-scale 1e14", "--floor-scale is 1e+14; expected at most 10000"),
        ("run --map robot-arm --lap 1e-9", "--lap is 1e-09; expected 0.1 s or more, and finite"),
        ("run --lap 1e10 --clips walk run", "--lap is 1e+10; expected at most 86400 s"),
        ("run --map robot-arm --radius 5", "the Phantom does not reach (4.330, 0.000, 2.500) m of the hand frame"),
        ("hardware doctor --seconds 1e12", "--seconds is 1e+12; expected at most 3600 s"),
        ("hardware calibrate --seconds 1e12", "--seconds is 1e+12; expected at most 3600 s"),
    ],
)
def test_excessive_number_is_refused_in_one_line(
    words: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    assert capsys.readouterr().err.strip() == f"hvf: {message}"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("trials", 'seconds = 1e15\n[factors]\nstiffness = [100, 200]', "seconds is 1e+15; expected at most 86400 s"),
        ("tune", "seconds = 1e15\n[space]\nstiffness = {low = 1, high = 2}",
         "seconds is 1e+15; expected at most 86400 s"),
        ("tune", "[space]\nstiffness = {low = inf, high = 2}", "low is inf; expected 0 or more, and finite"),
        ("tune", "candidates = 1000000000000\n[space]\nstiffness = {low = 1, high = 2}",
         "tuning 'mine': 1000000000000 candidates, 6 users, 1 tasks, 1 repetitions are too many; expected at most "
         "1000000 trials"),
    ],
)  # fmt: skip
def test_file_with_excessive_number_is_refused_in_one_line(
    command: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f'name = "mine"\n{text}\n', encoding="utf-8")
    assert main([command, str(file), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.strip() == f"hvf: {file}: {message}"
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


def test_integer_option_in_tuning_space_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text('name = "mine"\n[space]\nfigure_ticks = { low = 1, high = 3 }\n', encoding="utf-8")
    assert main(["tune", str(file), "--out", str(out)]) == 2
    assert "figure_ticks is 1.6" in capsys.readouterr().err
    assert not out.exists()


def test_person_of_large_population_is_drawn_alone() -> None:
    assert persona("7:2") == population(3, 7)[2]
    assert persona("7:999999").name == "7:999999"  # in no time, where a population of a million takes minutes
    with pytest.raises(SimError, match="no person '7:1000000'"):
        persona("7:1000000")


@pytest.mark.parametrize("option", ["--stiffness", "--damping"])
def test_gains_beyond_any_device_are_refused(option, tmp_path, capsys):
    assert main(["run", option, "1e308", "--out", str(tmp_path / "none")]) == 2
    assert "expected at most" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
