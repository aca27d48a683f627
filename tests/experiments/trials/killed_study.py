"""A study whose driver and workers are killed at random moments until it is done, for the tests.

``python tests/experiments/trials/killed_study.py 20 60`` does it with 20 kills in a study of 960 trials and compares
the tables. ``… 7 60 FOLDER 3`` does it in a folder, with 7 kills at the moments of seed 3, and may be run again with
other seeds: what there is to compare with is kept there.
"""

import contextlib
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

STUDY = """
name = "killed"
seconds = 0.5
repetitions = {repetitions}
ease = "tracking_error"
cost = "effort"
measures = ["tracking_error", "effort", "sparc"]
[run]
figure = "none"
[users]
number = 4
[factors]
stiffness = [100, 300]
damping = [4, 8]
"""


def written(folder: Path, repetitions: int) -> Path:
    """The study's file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "killed.toml"
    path.write_text(STUDY.format(repetitions=repetitions), encoding="utf-8")
    return path


def start(study: Path, out: Path, *options: str) -> subprocess.Popen[bytes]:
    """A driver in a process of its own."""
    command = [sys.executable, "-m", "experiments.cli", "trials", str(study), "--out", str(out), *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def finish(driver: subprocess.Popen[bytes]) -> None:
    """Wait for a driver that is not killed."""
    _, stderr = driver.communicate(timeout=1500)
    assert driver.returncode == 0, stderr.decode()


def workers_of(driver: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """Worker processes of a driver's local cluster."""
    found: list[psutil.Process] = []
    with contextlib.suppress(psutil.Error):
        for child in psutil.Process(driver.pid).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                found += [child] if "spawn_main" in " ".join(child.cmdline()) else []
    return found


def killed_at_random(study: Path, out: Path, kills: int, seed: int) -> dict[str, int]:
    """Kill driver and workers in turn at random moments of a study with two workers, then let it finish.

    The first worker is killed as soon as it is there, before it has started. Returns how often each was killed: fewer
    than asked for if the study was done before.
    """
    rng, killed, orphans = random.Random(seed), {"worker": 0, "driver": 0}, list[psutil.Process]()
    driver = start(study, out, "--workers", "2")
    try:
        while sum(killed.values()) < kills:
            if killed["worker"] > killed["driver"]:
                time.sleep(rng.uniform(0.0, 8.0))
                orphans += workers_of(driver)
                driver.kill()
                driver.communicate()
                driver = start(study, out, "--workers", "2")
                killed["driver"] += 1
                continue
            while not workers_of(driver) and driver.poll() is None:
                time.sleep(0.1)
            time.sleep(rng.uniform(0.0, 4.0) if sum(killed.values()) else 0.0)
            workers = workers_of(driver)
            if driver.poll() is not None or not workers:
                break  # it is done before all the kills
            with contextlib.suppress(psutil.Error):
                rng.choice(workers).kill()
            killed["worker"] += 1
        finish(driver)
    finally:
        driver.kill()
        driver.communicate()
        _, alive = psutil.wait_procs(orphans, timeout=120)  # a busy machine is slow to notice
        for process in alive:
            process.kill()
    assert not alive, "workers outlive their driver"
    return killed


def main(kills: int, repetitions: int = 40, folder: str = "", seed: int = 1) -> None:
    """Compare a study that is killed with one that is not, and with one on one thread."""
    with contextlib.ExitStack() as stack:
        out = Path(folder or stack.enter_context(tempfile.TemporaryDirectory()))
        study = written(out, repetitions)
        killed = killed_at_random(study, out / f"killed-{seed}", kills, seed)
        print(killed, flush=True)
        finish(start(study, out / "undisturbed", "--workers", "2"))
        finish(start(study, out / "one", "--threads", "1"))
        tables = [(out / run / "trials.csv").read_bytes() for run in (f"killed-{seed}", "undisturbed", "one")]
        print("rows:", tables[0].count(b"\n") - 1, "identical:", tables[0] == tables[1] == tables[2])


if __name__ == "__main__":
    main(*(int(word) if word.isdecimal() else word for word in sys.argv[1:]))  # pyright: ignore[reportArgumentType]
