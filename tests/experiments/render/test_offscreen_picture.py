"""`hvf picture` on a machine without a display."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def _draw(out: Path, picture: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "DISPLAY")}
    command = [sys.executable, "-m", "experiments.cli", "picture", str(out), str(picture)]
    return subprocess.run(
        command, env=inherited | {"PYTHONPATH": str(ROOT)} | environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("backend", [None, "glfw", "bogus"])
def test_picture_is_drawn_without_display_for_any_mujoco_gl(
    backend: str | None, run_folder: Path, tmp_path: Path
) -> None:
    picture = tmp_path / "x.png"  # a new file, for existing ones are not replaced
    completed = _draw(run_folder, picture) if backend is None else _draw(run_folder, picture, MUJOCO_GL=backend)
    assert "Traceback" not in completed.stderr
    if completed.returncode == 2:  # a machine without EGL and OSMesa
        assert "expected EGL or OSMesa: apt-get install" in completed.stderr
        pytest.skip("nothing can be drawn on this machine")
    assert completed.returncode == 0, completed.stderr
    assert picture.stat().st_size > 10_000
