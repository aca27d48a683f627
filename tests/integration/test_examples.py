"""Every example script runs unchanged and prints its expected result."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PRINTS = {
    "follow": "largest force",
    "own_law": "the least of 2 cases of user-defined laws; so is any switching between them",
    "sweep_gains": "k_r = 400 N/m",
    "step_by_step": "half way after",
    "edited_motion": "edited.bvh: 3.0 s",
    "own_hand": "she felt",
    "replayed_hand": "the same hand would feel",
    "lifted_map": "walk → run",
    "own_map": "a push bows the trunk",
    "own_device": "1 N moved it by",
    "robot_arm": "The joints turn through",
}


def test_every_example_has_an_expected_output() -> None:
    assert {path.stem for path in EXAMPLES} == PRINTS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_and_prints_its_result(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    if path.stem == "own_law":  # compiles a law of `__main__`, which another process has to find
        subprocess.run([sys.executable, path], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=True)
    else:
        monkeypatch.chdir(tmp_path)
        runpy.run_path(str(path), run_name="__main__")
    assert PRINTS[path.stem] in capfd.readouterr().out
    assert not list(tmp_path.iterdir())
