"""Progress on the terminal: of simulated time, and of work by how long it took last time on this machine."""

import json
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from geometry.whole_files import write_text
from sim.compilation.unit_cache import cache_folder

_MIN_STORED_DURATION = 2.0  # [s]; shorter durations are not stored


class _RemainingTimeColumn(ProgressColumn):
    """Column of the elapsed time and the expected remaining time."""

    def __init__(self, expected: float | None):
        super().__init__()
        self._expected = expected

    def render(self, task: Task) -> Text:
        """As ``12 s, about 18 s left``."""
        return Text(remaining_text(task.elapsed or 0.0, self._expected))


def remaining_text(elapsed: float, expected: float | None) -> str:
    """Elapsed time and, if the duration was measured before, remaining time, in words; both [s]."""
    if expected is None:
        return f"{elapsed:.0f} s"
    if elapsed > expected:
        return f"{elapsed:.0f} s, longer than the {expected:.0f} s of the last time"
    return f"{elapsed:.0f} s, about {expected - elapsed:.0f} s left"


@contextmanager
def working(what: str, share: float = 1.0) -> Generator[None]:
    """Show on stderr, if it is a terminal, what is being done and how long it still takes.

    Parameters
    ----------
    what : str
        Name of the work, such as ``lifting``, under which its duration is stored.
    share : float
        Amount of work in its own units, such as clips; the duration is taken to be proportional to it.
    """
    console, began = Console(stderr=True), time.perf_counter()
    seconds = expected_seconds(what)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), _RemainingTimeColumn(seconds and share * seconds))
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        bar.add_task(what, total=None)
        yield
    taken = time.perf_counter() - began
    if taken > _MIN_STORED_DURATION:
        store_duration(what, taken / share)


@contextmanager
def simulating(console: Console, seconds: float) -> Generator[Callable[[float], None]]:
    """Show a bar of the simulated time of a run of `seconds` [s]; yields a function to call with the time reached."""
    columns = TextColumn("simulating"), BarColumn(), TextColumn("{task.completed:.1f} of {task.total:.1f} s")
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("", total=seconds)
        yield lambda t: bar.update(task, completed=t)


def expected_seconds(what: str) -> float | None:
    """Duration per unit of some work the last time on this machine [s]; None if it is not known."""
    return _stored_durations().get(what)


def _durations_file() -> Path:
    return cache_folder() / "durations.json"


def _stored_durations() -> dict[str, float]:
    """Stored durations [s] by name; empty if the file is missing or unreadable, as they only serve estimates."""
    try:
        stored = json.loads(_durations_file().read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(stored, dict):
        return {}
    items = cast(dict[str, object], stored).items()
    return {name: float(value) for name, value in items if isinstance(value, int | float) and value > 0.0}


def store_duration(what: str, seconds: float) -> None:
    """Store the duration of one unit of some work [s]; a file that cannot be written is ignored."""
    try:
        _durations_file().parent.mkdir(parents=True, exist_ok=True)
        write_text(_durations_file(), json.dumps(_stored_durations() | {what: float(f"{seconds:.3g}")}))
    except OSError:
        return
