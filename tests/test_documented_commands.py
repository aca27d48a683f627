"""Commands of README, tutorials and how-to pages, run in their order."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from experiments import commands as hvf_commands
from experiments.studies.residual_spread import README, stated_residuals
from tests.test_docs import DOCS, PAGES, ROOT, blocks, commands, name

FALLING = ["hvf run --clips backflip --governor"]  # as their pages say
PREREQUISITES = {  # results of other pages that a page needs
    "docs/how-to/blender.md": ["hvf run --seconds 1 --out runs/demo"],
    "docs/how-to/certify.md": ["hvf run --seconds 1 --out runs/demo", "hvf lift walk run --out runs/map.npz"],
    "docs/how-to/devices.md": ["hvf run --out runs/mine"],
}
# Need another machine or device; run until stopped (see tests/live); need the reader's own rig (see test_role_file).
NOT_RUN_HERE = ["--cluster tcp://head", "--device NAME", "hvf live ", "--roles roles.toml"]
PROVIDED_FILES = {
    "mine.bvh": "models/mocap/clips/walk.bvh",
    "back.bvh": "models/mocap/clips/walk.bvh",
    "hidden.json": "examples/hidden.json",
    "own_device.py": "examples/own_device.py",
}
COMMAND_PAGES = [page for page in PAGES if page == ROOT / "README.md" or page.parent.name in ("tutorials", "how-to")]
NAMES = [[command] for command in hvf_commands.NAMES if command != "clips"] + [["COMMAND", "--help"]]
EXPLANATIONS = [page for page in PAGES if page.parent == DOCS / "explanation"]
ROW = re.compile(r"^\| [^|]+ \| `(hvf run [^`]+)` \| ([^|]+) \|$", re.MULTILINE)
SPREAD = 1.5  # points of residual beyond what a row says, for seeds and processors not tried (`residual_spread`)
CLOCKED, PAUSED = "hvf hardware run", ("no new reading for", "the servo was")  # output on a machine that pauses
MISSED = re.compile(r"(\d+) ticks, (\d+) deadlines missed")
MAX_MISSED_SHARE = 0.05  # of the deadlines: with more missed, a run on a device is not judged
TRIES = 12  # a host that pauses for milliseconds makes devices stop, as they should
TIMEOUT = 3600.0  # [s] timeout; user studies and tunings take long on a busy machine


def lines(page: Path) -> list[str]:
    """Commands of a page, each once; the mere name of a command does not count."""
    if page in COMMAND_PAGES:
        found = [line for line in commands(page) if line.startswith("hvf ") and line.split()[1:] not in NAMES]
    else:
        found = [line for block in blocks(page, "") for line in block.splitlines() if line.startswith("hvf ")]
    normalised = dict.fromkeys(shlex.join(shlex.split(line, comments=True)) for line in found)
    return [line for line in normalised if not any(words in line for words in NOT_RUN_HERE)]


def run_command(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder."""
    return subprocess.run(
        [sys.executable, "-m", "experiments.cli", *arguments],
        cwd=folder, env={"MUJOCO_GL": "egl", "PYTHONPATH": str(ROOT), **os.environ},
        capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip


def run_in_time(line: str, arguments: list[str], folder: Path) -> tuple[subprocess.CompletedProcess[str], bool]:
    """Run a command, again if it runs against the clock and this machine paused; whether it was in time at last."""
    completed = run_command(arguments, folder)
    for tried in range(TRIES):
        ticks, missed = map(int, (MISSED.findall(completed.stdout) or [(1, 0)])[0])
        paused = missed > MAX_MISSED_SHARE * ticks or any(words in completed.stdout for words in PAUSED)
        if not line.startswith(CLOCKED) or not paused:
            return completed, True
        completed = run_command([*arguments, "--overwrite"], folder) if tried + 1 < TRIES else completed
    return completed, False


def test_every_readme_row_with_standing_figure_states_its_residual() -> None:
    stands = [line for line, measured in ROW.findall(README.read_text(encoding="utf-8")) if "stands" in measured]
    assert len(stands) >= 8
    assert [shlex.join(shlex.split(line)) for line in stands] == list(
        stated_residuals(README.read_text(encoding="utf-8"))
    )


@pytest.mark.commands
@pytest.mark.parametrize("page", [page for page in COMMAND_PAGES + EXPLANATIONS if lines(page)], ids=name)
def test_commands_of_page_give_the_stated_results(page: Path, tmp_path: Path) -> None:
    for file, source in PROVIDED_FILES.items():
        shutil.copy(ROOT / source, tmp_path / file)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    residuals, late = stated_residuals(page.read_text(encoding="utf-8")), []
    for line in PREREQUISITES.get(name(page), []) + lines(page):
        arguments = shlex.split(line)[1:]
        shutil.rmtree(tmp_path / "runs" / "run", ignore_errors=True)  # the default folder of a run
        completed, on_time = run_in_time(line, arguments, tmp_path)
        needs_late_recording = any(out in line for out in late)
        if not on_time or (completed.returncode and needs_late_recording):
            late.append(arguments[arguments.index("--out") + 1] if "--out" in arguments else line)
            continue
        assert completed.returncode == 0, f"{line}\n{completed.stderr}"
        fell = " fell at " in completed.stdout
        assert fell == any(line.startswith(words) for words in FALLING), f"{line}\n{completed.stdout}"
        if line in residuals:
            (low, high), out = residuals[line], arguments[arguments.index("--out") + 1]
            summary = json.loads((tmp_path / out / "summary.json").read_text(encoding="utf-8"))
            measured = 100.0 * summary["figure"]["residual_force_rms"]
            assert low - SPREAD <= measured <= high + SPREAD, f"{line}\n{completed.stdout}"
    if late:
        pytest.skip(f"this machine pauses; of {TRIES} times none in time: {', '.join(late)}")
