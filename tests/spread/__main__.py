"""Margins of the tests under other kernels, starts and seeds.

``python -m tests.spread FOLDER`` runs the tests that evaluate runs three times: unchanged; with OpenBLAS kernels for
Haswell, starts moved by 1e-9 and other seeds; and with kernels for Zen, starts moved by -1e-9 and a third set of seeds.
All comparisons of two numbers are written to FOLDER, those whose numbers varied to margins.csv in it, and the fifteen
with the smallest margins are printed as the table of `docs/validation/test-margins.md`.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.spread.margins import Margin, failures, margins
from tests.spread.plugin import FOLDER, SEED_OFFSET, START_OFFSET

RUNS: dict[str, dict[str, str]] = {
    "own": {},
    "haswell": {"OPENBLAS_CORETYPE": "Haswell", START_OFFSET: "1e-9", SEED_OFFSET: "100"},
    "zen": {"OPENBLAS_CORETYPE": "Zen", START_OFFSET: "-1e-9", SEED_OFFSET: "200"},
}
LOOKED_AT = ("experiments", "golden", "integration", "models/mocap", "sim", "controllers/certificates")
"""Folders of tests in which a figure is simulated or a run looked at, fast ones and slow."""
OF_THE_CLOCK = (
    "test_c_function", "test_command_interrupts", "test_hardware_command", "test_processes", "test_progress",
    "test_run_to_folder", "test_shared", "test_trial_cost",
)  # fmt: skip
"""Files in which what moves from run to run is the machine's time; they are in the CSV file and not in the table."""

_ROOT = Path(__file__).parents[2]
_TABLE_ROWS = 15


def run_tests(folder: Path, environment: Mapping[str, str], folders: tuple[str, ...] = LOOKED_AT) -> None:
    """Run the tests with an environment and record their comparisons in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.jsonl"):
        old.unlink()
    # Recorded assertions are compiled differently, so their byte code has a cache of its own.
    recording = {FOLDER: str(folder.resolve()), "PYTHONPYCACHEPREFIX": str((folder / "pycache").resolve())}
    subprocess.run(
        [
            sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadfile", "-p", "tests.spread.plugin",
            "-o", "enable_assertion_pass_hook=true", "-m", "not commands and not processes",
            *(f"tests/{name}" for name in folders),
        ],
        cwd=_ROOT, env={**os.environ, **recording, **environment}, check=False,
    )  # fmt: skip


def table(all_margins: list[Margin]) -> str:
    """The comparisons with the smallest margins as a Markdown table."""
    rows = ["| test | assertion | from and to | bound | room / spread |", "|---|---|---|---|---|"]
    figures = [margin for margin in all_margins if Path(margin.test.partition("::")[0]).stem not in OF_THE_CLOCK]
    for margin in figures[:_TABLE_ROWS]:
        file, _, name = margin.test.partition("::")
        rows.append(
            f"| `{Path(file).stem}`: {name.replace('_', ' ')} | `{margin.assertion}` "
            f"| {margin.least:.4g} to {margin.most:.4g} | {margin.relation} {margin.bound:.4g} | {margin.spreads:.1f} |"
        )
    return "\n".join(rows)


def main(folder: Path) -> None:
    """Run the tests, write the margins and print the table."""
    for name, environment in RUNS.items():
        run_tests(folder / name, environment)
    all_margins = margins(folder / name for name in RUNS)
    with (folder / "margins.csv").open("w", encoding="utf-8", newline="") as lines:
        rows = csv.writer(lines)
        rows.writerow([*Margin._fields, "spreads"])
        rows.writerows([*margin, f"{margin.spreads:.2f}"] for margin in all_margins)
    n_tests = len({margin.test for margin in all_margins})
    print(f"{len(all_margins)} comparisons of {n_tests} tests moved\n\n{table(all_margins)}")
    for test, runs in failures({name: folder / name for name in RUNS}).items():
        print(f"failed by {', '.join(sorted(runs))}: {test}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
