"""Spread of the residuals in README's table: over start positions, weights of the figure, and OpenBLAS kernels.

``python -m experiments.studies.residual_spread [CORE...]`` runs each row of README's table that states a residual three
times with each of the given OpenBLAS kernels (``OPENBLAS_CORETYPE``: Haswell, SkylakeX, Zen; by default those of this
processor), and prints the table of `docs/validation/residual-bounds.md`. A figure with contacts is chaotic: the runs
differ in the seed, which sets where the hand lets go of the stylus, and in the sixth digit of the figure's weight.
"""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from models.humanoid.skeleton import DEFAULT_MASS

README = Path(__file__).parents[2] / "README.md"
PERTURBATIONS = ((0, 0.0), (1, 1e-6), (2, -1e-6))
"""Seed, and relative change of the figure's weight, of each repetition."""

_ROW = re.compile(r"^\| [^|]+ \| `(hvf (?:run|lift) [^`]+)` \| ([^|]+) \|$", re.MULTILINE)
_RESIDUAL = re.compile(r"residual ([\d.]+)(?: to ([\d.]+))? %")


def stated_residuals(page: str) -> dict[str, tuple[float, float]]:
    """Commands in the rows of a page, with the lowest and highest residual [%] that each row states."""
    found = ((shlex.join(shlex.split(line)), _RESIDUAL.search(measured)) for line, measured in _ROW.findall(page))
    return {line: (float(stated[1]), float(stated[2] or stated[1])) for line, stated in found if stated is not None}


def measured(line: str, folder: Path, core: str) -> tuple[float, bool]:
    """Run a command in a folder with a kernel; returns its residual [%], and whether its figure fell."""
    words = shlex.split(line)
    _run_command(words, folder, core)
    summary = json.loads((folder / words[words.index("--out") + 1] / "summary.json").read_text(encoding="utf-8"))
    return 100.0 * summary["figure"]["residual_force_rms"], bool(summary["figure"]["falls"])


def _run_command(words: Sequence[str], folder: Path, core: str) -> None:
    environment = {**os.environ, "PYTHONPATH": str(README.parent), **({"OPENBLAS_CORETYPE": core} if core else {})}
    command = [sys.executable, "-m", "experiments.cli", *words[1:], "--overwrite"]
    subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)


def main(cores: Sequence[str]) -> None:
    """Print the table."""
    page = README.read_text(encoding="utf-8")
    with TemporaryDirectory() as scratch:
        folders = {core: Path(scratch) / (core or "own") for core in cores or [""]}
        for core, folder in folders.items():
            folder.mkdir()
            for line, _ in _ROW.findall(page):
                if line.startswith("hvf lift "):
                    _run_command(shlex.split(line), folder, core)
        print("| command | README says % | residual %, from and to | falls |\n|---|---|---|---|")
        for line, (low, high) in stated_residuals(page).items():
            runs = [
                measured(f"{line} --seed {seed} --mass {DEFAULT_MASS * (1.0 + nudge)!r}", folder, core)
                for core, folder in folders.items()
                for seed, nudge in PERTURBATIONS
            ]
            residuals, falls = [residual for residual, _ in runs], sum(fell for _, fell in runs)
            print(
                f"| `{line}` | {low:g} to {high:g} | {min(residuals):.2f} to {max(residuals):.2f} "
                f"| {falls} of {len(runs)} |",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
