"""Compilation of the units that a run needs, before the run, in separate processes and with a progress bar."""

from collections.abc import Callable, Sequence
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from sim.compilation.unit_workers import compile_units, missing_units
from sim.compilation.units import Unit


def compiler(console: Console) -> Callable[[Sequence[Unit]], None]:
    """Function that compiles those of given units that are not in the cache, and says so on the console.

    A failed compilation is not reported here: the run compiles the unit again and raises the error.
    """
    return partial(_compile_missing, console)


def _compile_missing(console: Console, units: Sequence[Unit]) -> None:
    waiting = list(missing_units(units))
    if not waiting:
        return
    console.print("Compiling what this run needs; it is kept until that changes.")
    columns = (TextColumn("compiling"), BarColumn(), TextColumn("{task.completed} of {task.total}"))
    time_columns = (TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[names]}"))
    with Progress(*columns, *time_columns, console=console) as progress:
        task = progress.add_task("", total=len(waiting), names=_names(waiting))

        def done(unit: Unit) -> None:
            waiting.remove(unit)
            progress.update(task, advance=1, names=_names(waiting))

        compile_units(tuple(waiting), done)


def _names(units: Sequence[Unit]) -> str:
    return ", ".join(unit.name.strip("_") for unit in units)
