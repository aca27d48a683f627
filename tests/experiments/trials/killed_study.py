"""A study whose driver and workers are killed at random moments until it is done, for the tests.

``python -m tests.experiments.trials.killed_study 20`` does it with 20 kills and compares the tables.
"""

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
    """Wait for a driver that is left alone."""
    _, said = driver.communicate(timeout=500)
    assert driver.returncode == 0, said.decode()


def workers_of(driver: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """Worker processes of a driver's local cluster."""
    try:
        children = psutil.Process(driver.pid).children(recursive=True)
        return [child for child in children if any("spawn_main" in part for part in child.cmdline())]
    except psutil.Error:
        return []


def killed_at_random(study: Path, out: Path, kills: int, seed: int) -> dict[str, int]:
    """Kill driver or a worker at random moments of a study with two workers, then let it finish; how often each was."""
    rng, killed = random.Random(seed), {"driver": 0, "worker": 0}
    driver, orphans = start(study, out, "--workers", "2"), list[psutil.Process]()
    try:
        while sum(killed.values()) < kills:
            time.sleep(rng.uniform(0.2, 6.0))
            workers = workers_of(driver)
            victim = "driver" if rng.random() < 0.5 or not workers else "worker"
            if driver.poll() is not None:
                break  # it is done before all the kills
            if victim == "worker":
                rng.choice(workers).kill()
            else:
                orphans += workers
                driver.kill()
                driver.communicate()
                driver = start(study, out, "--workers", "2")
            killed[victim] += 1
        finish(driver)
    finally:
        driver.kill()
        driver.communicate()
        _, alive = psutil.wait_procs(orphans, timeout=30)
        for process in alive:
            process.kill()
    assert not alive, "workers outlive their driver"
    return killed


def main(kills: int, repetitions: int, seed: int) -> None:
    """Compare a study that is killed with one that is not, and with one on one thread."""
    with tempfile.TemporaryDirectory() as folder:
        study = written(Path(folder), repetitions)
        killed = killed_at_random(study, Path(folder) / "killed", kills, seed)
        finish(start(study, Path(folder) / "undisturbed", "--workers", "2"))
        finish(start(study, Path(folder) / "one", "--threads", "1"))
        tables = [(Path(folder) / run / "trials.csv").read_bytes() for run in ("killed", "undisturbed", "one")]
        print(killed, "rows:", tables[0].count(b"\n") - 1, "identical:", tables[0] == tables[1] == tables[2])


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 40, 1)
