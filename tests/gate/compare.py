"""Gate for refactorings: short runs of a commit and of this tree, compared bit for bit.

``python tests/gate/compare.py COMMIT [CASE ...]`` checks the commit out into a worktree of its own, runs every case
there and here on this machine, both at once, and compares every channel of the two recordings. Stored hashes of
recordings would not do: libraries round by processor, and a figure with contacts magnifies the difference. A case that
needs the recording or map of another one includes that case.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
_MAP, _RUN = "MAP", "RUN"  # placeholders for the lifted map's file and for the folder of the case "follow"
_SCRIPT = "SCRIPT"  # a script of this folder; its arguments are the output folder and further ones
_NEEDS = {"lifted": "lift", "lifted-rivers": "lift", "reproduce": "follow", "replay": "follow"}

CASES = {
    "follow": "run --seconds 2",
    "follow-push": "run --user push --lap 1.5 --seconds 3 --seed 2",
    "bunny": "run --mode bunny --bunny-attraction along --user trace --seconds 2",
    "rivers": "run --mode rivers --user push --seconds 4",
    "rivers-smooth": "run --mode rivers --crossing smooth --seconds 2",
    "rivers-sum": "run --mode rivers --crossing sum --seconds 1",
    "map-rivers": "run --mode rivers --map rivers --user push --seconds 4",
    "composite": "run --map composite --clips walk angry cheer --seconds 2",
    "stretch": "run --mode stretch --seconds 6",
    "stretch-then-follow": "run --mode stretch-then-follow --bump 0.3 --seconds 12",
    "lead": "run --mode lead --seconds 4",
    "lead-run": "run --mode lead --clips run --seconds 4",
    "expressive": "run --expressive --user turn --orientation-stiffness 0.05 --lap 2 --seconds 4",
    "walls": "run --walls --clips ginga angry --seconds 2",
    "governor": "run --clips backflip --governor --seconds 2",
    "lift": f"lift walk run jump --out {_MAP}",
    "lifted": f"run --map {_MAP} --curve run --seconds 2",
    "lifted-rivers": f"run --map {_MAP} --curve walk --mode rivers --user push --seconds 4",
    "arm": "run --map robot-arm --user push --seconds 3",
    "kinematic": "run --figure kinematic --user push --seconds 2",
    "no-figure": "run --figure none --user push --seconds 2",
    "person": "run --person median --user push --seconds 3",
    "person-changes": "run --mode rivers --map rivers --person median --user change --figure kinematic --seconds 3",
    **{
        f"person-{does}": f"run --person median --user {does} --figure kinematic --seconds 2"
        for does in ("trace", "exaggerate", "cut", "resist", "lost")
    },
    "own-law": f"{_SCRIPT} own_law.py",
    "compiled-law": f"{_SCRIPT} compiled_law.py",
    "reproduce": f"reproduce {_RUN}",
    "replay": f"run --replay {_RUN} --seconds 2",
}


def command(case: str, folder: Path) -> list[str]:
    """Command that runs a case and writes into the case's own folder."""
    substitutes = {_MAP: str(folder / "map.npz"), _RUN: str(folder / "follow")}
    first, *others = (substitutes.get(word, word) for word in CASES[case].split())
    out = str(folder / case)
    if first == _SCRIPT:
        script, *arguments = others
        return [sys.executable, str(Path(__file__).with_name(script)), out, *arguments]
    return [sys.executable, "-m", "experiments.cli", first, *others, *(["--out", out] if first == "run" else [])]


def start(case: str, tree: Path, folder: Path) -> "subprocess.Popen[bytes]":
    """Start a case in a tree."""
    log = (folder / f"{case}.log").open("wb")
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONSAFEPATH": "", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(command(case, folder), cwd=tree, env=environment, stdout=log, stderr=log)


def differences(before: Path, after: Path) -> Iterator[str]:
    """Channels of two recordings that differ in any bit."""
    with h5py.File(before) as old, h5py.File(after) as new:
        for group in ("ticks", "frames"):
            for name in sorted({*old[group], *new[group]} - {"rows"}):
                if name not in old[group] or name not in new[group]:
                    yield f"{group}/{name} is in one of them only"
                    continue
                was, now = (np.atleast_1d(file[group][name][()]) for file in (old, new))
                if was.shape != now.shape:
                    yield f"{group}/{name} has shape {now.shape}, had {was.shape}"
                elif was.tobytes() != now.tobytes():
                    rows = np.any((was != now).reshape(len(was), -1), axis=1)
                    most = np.nanmax(np.abs(was - now))
                    yield f"{group}/{name} differs from row {int(np.argmax(rows))} on, by {most:.3g} at most"


def gate(commit: str, cases: list[str]) -> int:
    """Run the cases in both trees and compare; 1 if anything differs."""
    failed: list[str] = []
    cases = [case for case in CASES if case in cases or case in {_NEEDS.get(other) for other in cases}]
    with tempfile.TemporaryDirectory() as scratch:
        tree, folders = Path(scratch) / "tree", (Path(scratch) / "before", Path(scratch) / "after")
        subprocess.run(["git", "worktree", "add", "--detach", "--quiet", str(tree), commit], cwd=ROOT, check=True)
        try:
            for folder in folders:
                folder.mkdir()
            for case in cases:
                runs = [start(case, place, folder) for place, folder in zip((tree, ROOT), folders, strict=True)]
                codes = [run.wait() for run in runs]
                messages = [
                    f"exit code {code} {side}" for code, side in zip(codes, ("before", "after"), strict=True) if code
                ]
                if messages:
                    messages += [(folder / f"{case}.log").read_text()[-800:] for folder in folders]
                elif case == "reproduce":
                    messages = (
                        [] if len({(folder / f"{case}.log").read_text() for folder in folders}) == 1 else ["the text"]
                    )
                elif case == "lift":
                    with np.load(folders[0] / "map.npz") as was, np.load(folders[1] / "map.npz") as now:
                        messages = [name for name in was.files if was[name].tobytes() != now[name].tobytes()]
                else:
                    messages = list(differences(*(folder / case / "run.h5" for folder in folders)))
                print(f"{case}: {'; '.join(messages) or 'the same'}", flush=True)
                failed += [case] if messages else []
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(tree)], cwd=ROOT, check=True)
    print(f"{len(cases) - len(failed)} of {len(cases)} cases are the same, bit for bit, as on {commit}")
    return 1 if failed else 0


if __name__ == "__main__":
    if len(sys.argv) < 2 or set(sys.argv[2:]) - CASES.keys():
        sys.exit(f"usage: compare.py COMMIT [CASE ...], cases {' '.join(CASES)}")
    sys.exit(gate(sys.argv[1], sys.argv[2:] or list(CASES)))
