"""Costs of a study besides its trials: overhead, scaling over threads, memory, and start-up time.

``python -m experiments.bench.trial_cost 10000`` prints the overhead, and how memory grows over 10000 short trials.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import psutil
from rich.console import Console

from experiments.config.part import to_json
from experiments.trials.design.plan import Trial, plan_trials
from experiments.trials.design.study_config import StudyConfig, parse_study
from experiments.trials.execution.database import Database
from experiments.trials.execution.drive import compile_and_make_maps, run_missing
from experiments.trials.execution.executors import Threads
from experiments.trials.trial.run_trial import Row, Task

_THREAD_COUNT, _SHORT_TIME, _SHORT_COUNT = 2, 0.02, 2_000  # simultaneous trials; short trials: duration [s] and number


class TrialCost(NamedTuple):
    """Ratios of a study without a figure to its trials, and its start time.

    Processor time beside the trials over theirs; trials per second of two threads over twice those of one; memory after
    2000 short trials over that after 400; time from the start of a process to its first row, with code compiled [s].
    """

    overhead: float
    scaling: float
    grown: float
    start: float


def trial_cost() -> TrialCost:
    """Measure all ratios; needs an idle machine, as some times are wall-clock times."""
    quiet = Console(stderr=True, quiet=True)
    added, one = overhead(6, 5.0, quiet)
    _, two = _run_study(_make_study(6, 5.0), Threads(_THREAD_COUNT), quiet)
    return TrialCost(added, one / (_THREAD_COUNT * two), grown(_SHORT_COUNT, quiet), start_seconds())


def overhead(users: int, seconds: float, console: Console) -> tuple[float, float]:
    """Processor time of planning, driving and database over that of the trials, and the total time [s]."""
    compile_and_make_maps([trial.config for trial in plan_trials(_make_study(1, 0.1))[:1]], console)
    begin = time.process_time()
    trial_seconds, study_seconds = _run_study(_make_study(users, seconds), Threads(1), console)
    return (time.process_time() - begin) / trial_seconds - 1.0, study_seconds


def grown(trials: int, console: Console) -> float:
    """Memory of this process after a number of short trials of a study, over that after a fifth of them."""
    watch = _MemoryWatch(trials // 5)
    _run_study(_make_study(trials // 4, _SHORT_TIME), watch, console)
    return psutil.Process().memory_info().rss / watch.memory


class _MemoryWatch(Threads):
    """An executor with one thread that stores the memory of the process after a number of trials."""

    def __init__(self, after: int):
        super().__init__(1)
        self._after, self.memory = after, 0

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        for done, row in enumerate(super().rows(tasks)):
            if done == self._after:
                self.memory = psutil.Process().memory_info().rss
            yield row


def start_seconds() -> float:
    """Time from the start of a new process to the first row of its study [s]."""
    code, begin = "from experiments.bench.trial_cost import first_row; first_row()", time.perf_counter()
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        return time.perf_counter() - begin


def first_row() -> None:
    """Run the first trial of a study, and print its state."""
    study = _make_study(1, _SHORT_TIME)
    trial = plan_trials(study)[0]
    compile_and_make_maps([trial.config], Console(stderr=True, quiet=True))
    print(next(iter(Threads(1).rows([Task(trial.key, to_json(trial.config))]))).state, flush=True)


def _make_study(users: int, seconds: float) -> StudyConfig:
    values: Mapping[str, object] = {
        "name": "cost", "seconds": seconds, "run": {"figure": "none"}, "users": {"number": users},
        "factors": {"stiffness": [100, 300], "damping": [4, 8]},
    }  # fmt: skip
    return parse_study(values, "cost")


def _run_study(study: StudyConfig, executor: Threads, console: Console) -> tuple[float, float]:
    """The trials' own processor time, and the time that the study took [s]."""
    with tempfile.TemporaryDirectory() as folder, Database(Path(folder) / "s.sqlite", "cost", "cost", "") as database:
        begin = time.perf_counter()
        trials: tuple[Trial, ...] = plan_trials(study)
        factors = {trial.key: {"user": trial.design.user} for trial in trials}
        run_missing(trials, database, executor, "", console, factors)
        return sum(row.seconds for row in database.rows()), time.perf_counter() - begin


def _main(trials: int) -> None:
    quiet = Console(stderr=True, quiet=True)
    print(f"a study beside its trials: {100.0 * overhead(6, 5.0, quiet)[0]:.2f} % of processor time")
    print(f"memory after {trials} short trials, over that after {trials // 5}: {grown(trials, quiet):.3f}")


if __name__ == "__main__":
    _main(int(sys.argv[1]))
