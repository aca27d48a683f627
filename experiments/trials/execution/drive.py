"""The driver of trials: runs the trials that are not in the database yet, and stores every row as it arrives."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Task as BarTask
from rich.text import Text

from experiments.config.part import to_json
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.setups.modes.follow import flows_parallel
from experiments.setups.parts.defaults import resolved
from experiments.trials.design.plan import Trial
from experiments.trials.design.study_config import StudyError
from experiments.trials.execution.database import Database
from experiments.trials.trial.run_trial import MAP_CACHE, Row, Task


class Executor(Protocol):
    """Runs tasks: on threads of this process or on a cluster."""

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """Yield rows of tasks as they are completed."""
        ...


class _RateColumn(ProgressColumn):
    """Column of the progress bar with the number of trials per minute."""

    def render(self, task: BarTask) -> Text:
        return Text(f"{60.0 * (task.finished_speed or task.speed or 0.0):.0f}/min")


def compile_and_make_maps(configs: Iterable[RunConfig], console: Console) -> None:
    """Compile the units that trials need, once for each kind of run, and make their maps."""
    for config in {_compilation_key(config): config for config in configs}.values():
        MAP_CACHE.session(config, compiler(console))


def _compilation_key(config: RunConfig) -> object:
    """Key of the settings that determine which compiled units and which map a run needs."""
    options = tuple(getattr(config.mode, name, None) is not None for name in ("orientation", "governor", "walls"))
    flow = flows_parallel(resolved(config))
    return config.mode.kind, options, flow, config.map, config.figure.kind, config.user.does, bool(config.user.turns)


_PROBE_FILE = ".hvf"


def check_writable(url: str) -> None:
    """Write an empty file to a folder or URL, and remove it again.

    Raises
    ------
    StudyError
        If nothing can be written there.
    """
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(url)
        system.makedirs(path, exist_ok=True)
        system.pipe_file(f"{path}/{_PROBE_FILE}", b"")
        system.rm_file(f"{path}/{_PROBE_FILE}")
    except Exception as error:  # every storage backend has its own exceptions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StudyError(
            f"recordings = {url!r}: {reason}; expected a folder, or a URL that fsspec can write to"
        ) from None


def run_missing(
    trials: Sequence[Trial], database: Database, executor: Executor, recordings: str, console: Console,
    what: Mapping[str, Mapping[str, object]],
) -> int:  # fmt: skip
    """Run all trials that the database lacks; returns how many were run.

    Parameters
    ----------
    trials : sequence of Trial
        All trials of the study.
    database : Database
        Database in which rows are stored.
    executor : Executor
        Runs the trials.
    recordings : str
        Folder or URL of recordings; empty for none.
    console : Console
        Where progress is shown.
    what : mapping
        Descriptions of the trials for readers of the database, by key.

    Raises
    ------
    StudyError, OSError
        If the study cannot go on; completed trials are kept.
    """
    stored = database.keys()
    missing = [trial for trial in trials if trial.key not in stored]
    if not missing:
        return 0
    columns = (
        TextColumn("trials"), BarColumn(), TextColumn("{task.completed} of {task.total}"), _RateColumn(),
        TimeRemainingColumn(), TextColumn("{task.fields[failed]}"),
    )  # fmt: skip
    failed = 0
    rows = executor.rows(Task(trial.key, to_json(trial.config), recordings) for trial in missing)
    stored_count = len(trials) - len(missing)
    if recordings and stored_count:
        console.print(f"{stored_count} trials ran before; only those that run now are recorded for certain")
    with Progress(*columns, console=console, speed_estimate_period=60.0) as progress:
        bar = progress.add_task("", total=len(trials), completed=stored_count, failed="none failed")
        progress.advance(bar, 0)  # first sample of time, from which the rate is estimated
        for row in rows:
            database.add(row, what[row.key])
            failed += row.state == "failed"
            progress.update(bar, advance=1, failed=f"{failed} failed" if failed else "none failed")
    return len(missing)
