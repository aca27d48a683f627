"""Every command that README, tutorials and how-to pages tell a reader to type is typed, in their order."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.cli import COMMANDS
from tests.test_docs import DOCS, PAGES, ROOT, blocks, commands, name

FALLS = ["--clips walk run jump angry", "--clips backflip --governor"]  # pages say so beside them
EARLIER = {  # what a page takes for granted: another page's result
    "docs/how-to/certify.md": ["hvf run --seconds 1 --out runs/demo", "hvf lift walk run --out runs/map.npz"],
}
TYPED = [page for page in PAGES if page == ROOT / "README.md" or page.parent.name in ("tutorials", "how-to")]
NAMES = [[command] for command in COMMANDS if command != "clips"] + [["COMMAND", "--help"]]
SHOWN = [page for page in PAGES if page.parent == DOCS / "explanation"]


def lines(page: Path) -> list[str]:
    """Each once; a command's mere name in a sentence is none."""
    if page in TYPED:
        found = [line for line in commands(page) if line.startswith("hvf ") and line.split()[1:] not in NAMES]
    else:
        found = [line for block in blocks(page, "") for line in block.splitlines() if line.startswith("hvf ")]
    return list(dict.fromkeys(shlex.join(shlex.split(line, comments=True)) for line in found))


@pytest.mark.commands
@pytest.mark.parametrize("page", [page for page in TYPED + SHOWN if lines(page)], ids=name)
def test_the_commands_of_a_page_do_what_it_says(page: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "models" / "mocap" / "clips" / "walk.bvh", tmp_path / "mine.bvh")
    shutil.copy(ROOT / "examples" / "hidden.json", tmp_path / "hidden.json")
    for line in EARLIER.get(name(page), []) + lines(page):
        arguments = shlex.split(line)[1:]
        shutil.rmtree(tmp_path / "runs" / "run", ignore_errors=True)  # the folder of a run that names none
        done = subprocess.run(
            [sys.executable, "-m", "experiments.cli", *arguments],
            cwd=tmp_path, env={"MUJOCO_GL": "egl", "PYTHONPATH": str(ROOT), **os.environ},
            capture_output=True, text=True, timeout=600, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        fell = " fell at " in done.stdout
        assert fell == any(clips in line for clips in FALLS), f"{line}\n{done.stdout}"
