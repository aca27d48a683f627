"""`--json`: the results of commands on stdout."""

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.cli import main
from experiments.preparation.tracking_trial import followed

ROOT = Path(__file__).resolve().parents[2]
WALK = ROOT / "models" / "mocap" / "clips" / "walk.bvh"


pytestmark = pytest.mark.usefixtures("without_page")


def _json(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_results_are_printed_as_json(run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    out = str(tmp_path / "run")
    result = _json(["run", "--figure", "none", "--seconds", "0.5", "--out", out], capsys)
    assert result["path"]["laps"] > 0.1
    assert result == json.loads(Path(out, "summary.json").read_text())
    assert _json(["reproduce", str(run_folder)], capsys)["same"] is True
    assert _json(["convert", str(WALK), str(tmp_path / "walk.bvh")], capsys)["lines"]
    assert {clip["name"] for clip in _json(["clips"], capsys)} >= {"walk", "run"}


@pytest.mark.slow
def test_results_of_slow_commands_are_printed_as_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("experiments.preparation.command.followed", lambda clip, seconds: followed(clip, 1.0))
    capsys.readouterr()
    assert _json(["track", "walk", "--seconds", "0.5"], capsys)["walk"]["root_error"] < 0.1
    assert _json(["run", "--map", "robot-arm", "--seconds", "1.5", "--out", str(tmp_path / "arm")], capsys)["lines"]
    assert _json(["prepare", str(WALK), str(tmp_path / "p.bvh")], capsys)["well_formed"]
    assert _json(["certify", "--clip", "walk", "--out", str(tmp_path / "c")], capsys)["ballistic"]["verdict"]
