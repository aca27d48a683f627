"""Every example script runs unchanged and prints its expected result."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PRINTS = {
    "follow": "largest force",
    "own_law": "critical k_r",
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
def test_example_runs_and_prints_its_result(path: Path, tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    completed = subprocess.run(
        [sys.executable, str(path)], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert completed.returncode == 0, completed.stderr
    assert PRINTS[path.stem] in completed.stdout
    assert not list(tmp_path.iterdir())
