"""Studies as real processes: workers, scheduler and drivers killed at random moments."""

import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from killed_study import finish, killed_at_random, start, written

pytest.importorskip("distributed")
pytest.importorskip("statsmodels")


@pytest.mark.processes
def test_killed_study_gives_the_table_of_an_undisturbed_one(tmp_path: Path) -> None:
    study = written(tmp_path, repetitions=8)
    killed = killed_at_random(study, tmp_path / "killed", kills=3, seed=int(time.time()))
    assert killed["worker"] >= 1
    finish(start(study, tmp_path / "one", "--threads", "1"))
    tables = [(tmp_path / run / "trials.csv").read_bytes() for run in ("killed", "one")]
    assert tables[0] == tables[1]
    assert tables[0].count(b"\n") == 1 + 4 * 4 * 8


@pytest.mark.processes
def test_lost_scheduler_is_one_line_and_the_study_resumes(tmp_path: Path) -> None:
    study = written(tmp_path, repetitions=30)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, quiet = f"tcp://127.0.0.1:{port}", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m"]
    scheduler = subprocess.Popen(
        [*dask, "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard"], **quiet
    )
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "20"]
    worker = subprocess.Popen([*dask, "distributed.cli.dask_worker", address, *options], **quiet)
    driver = start(study, tmp_path / "out", "--cluster", address)
    try:
        database = tmp_path / "out" / "study.sqlite-wal"
        until = time.monotonic() + 120.0
        while not (database.exists() and database.stat().st_size > 60_000) and time.monotonic() < until:
            time.sleep(0.1)
        scheduler.kill()
        _, stderr = driver.communicate(timeout=120)
    finally:
        for process in (driver, worker, scheduler):
            process.kill()
            process.wait()
    last = stderr.decode().strip().splitlines()[-1]
    assert driver.returncode == 2
    assert "the scheduler is lost" in last
    assert "every trial so far is kept" in last
    assert "Traceback" not in stderr.decode()
    finish(start(study, tmp_path / "out", "--threads", "2"))
    finish(start(study, tmp_path / "one", "--threads", "2"))
    assert (tmp_path / "out" / "trials.csv").read_bytes() == (tmp_path / "one" / "trials.csv").read_bytes()


def test_missing_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.trials.design.study_config import StudyError
    from experiments.trials.execution import cluster

    monkeypatch.setattr(cluster, "_MAX_WAIT", "1s")
    with pytest.raises(StudyError, match="no Dask scheduler answers"), cluster.cluster_at("tcp://127.0.0.1:9"):
        pass


def test_worker_with_other_code_or_files_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from experiments.config.options import run_config
    from experiments.config.part import to_json
    from experiments.trials.design.study_config import StudyError
    from experiments.trials.execution.cluster import perform_on_worker
    from experiments.trials.trial.run_trial import Task

    config = run_config(figure="none", seconds=0.5)
    with pytest.raises(StudyError, match=r"worker on .*differ from the driver's"):
        perform_on_worker(Task("another key", to_json(config)))
    lacking = run_config(figure="none", seconds=0.5, clips=(str(tmp_path / "gone.bvh"),))
    with pytest.raises(StudyError, match=r"worker on .*gone.bvh: No such file.*copy it there"):
        perform_on_worker(Task("key", to_json(lacking)))
