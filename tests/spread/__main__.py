"""How far the figures of tests stay from their bounds, by other kernels, starts and seeds.

``python -m tests.spread FOLDER`` runs the tests that look at runs thrice: as they are; with the kernels that OpenBLAS
picks on Haswell, starts moved by 1e-9 and other seeds; and with Zen's, starts moved back and seeds other than those.
What each comparison of two numbers had is written to FOLDER, every comparison whose numbers moved to margins.csv in
it, and the fifteen nearest to their bounds are printed as the table of `docs/validation/test-margins.md`.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.spread.margins import Margin, failures, margins
from tests.spread.plugin import FOLDER, MOVED, SEED

RUNS: dict[str, dict[str, str]] = {
    "own": {},
    "haswell": {"OPENBLAS_CORETYPE": "Haswell", MOVED: "1e-9", SEED: "100"},
    "zen": {"OPENBLAS_CORETYPE": "Zen", MOVED: "-1e-9", SEED: "200"},
}
LOOKED_AT = ("experiments", "golden", "integration", "models/mocap", "sim", "controllers/certificates")
"""Folders of tests in which a figure is simulated or a run looked at, fast ones and slow."""
OF_THE_CLOCK = (
    "test_c_function", "test_command_interrupts", "test_hardware_command", "test_processes", "test_progress",
    "test_run_to_folder", "test_shared", "test_trial_cost",
)  # fmt: skip
"""Files in which what moves from run to run is the machine's time; they are in the CSV file and not in the table."""

_ROOT = Path(__file__).parents[2]
_SHOWN = 15  # rows


def run_tests(folder: Path, environment: Mapping[str, str], folders: tuple[str, ...] = LOOKED_AT) -> None:
    """Run the tests with an environment; what they compared is in a folder then."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.jsonl"):
        old.unlink()
    # Assertions are compiled otherwise when they are looked at, so they are not kept where others are.
    surroundings = {FOLDER: str(folder.resolve()), "PYTHONPYCACHEPREFIX": str((folder / "pycache").resolve())}
    subprocess.run(
        [
            sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadfile", "-p", "tests.spread.plugin",
            "-o", "enable_assertion_pass_hook=true", "-m", "not commands and not processes",
            *(f"tests/{name}" for name in folders),
        ],
        cwd=_ROOT, env={**os.environ, **surroundings, **environment}, check=False,
    )  # fmt: skip


def table(found: list[Margin]) -> str:
    """The nearest to their bounds, as Markdown."""
    rows = ["| test | assertion | from and to | bound | room / spread |", "|---|---|---|---|---|"]
    figures = [margin for margin in found if Path(margin.test.partition("::")[0]).stem not in OF_THE_CLOCK]
    for margin in figures[:_SHOWN]:
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
    found = margins(folder / name for name in RUNS)
    with (folder / "margins.csv").open("w", encoding="utf-8", newline="") as lines:
        rows = csv.writer(lines)
        rows.writerow([*Margin._fields, "spreads"])
        rows.writerows([*margin, f"{margin.spreads:.2f}"] for margin in found)
    print(f"{len(found)} comparisons of {len({margin.test for margin in found})} tests moved\n\n{table(found)}")
    for test, runs in failures({name: folder / name for name in RUNS}).items():
        print(f"failed by {', '.join(sorted(runs))}: {test}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
