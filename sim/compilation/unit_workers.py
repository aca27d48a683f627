"""Parallel compilation of units, in processes that import only the units' modules."""

from collections.abc import Callable, Sequence

from sim.compilation.unit_key import reached_functions
from sim.compilation.units import Unit, unit_function
from sim.compilation.workers import run_in_workers


def missing_units(units: Sequence[Unit]) -> tuple[Unit, ...]:
    """The units that are not in the cache, the largest first."""

    def function_count(unit: Unit) -> int:
        return len(reached_functions(unit_function(unit.module, unit.name).py_func))

    missing = [unit for unit in dict.fromkeys(units) if not unit.is_kept()]
    return tuple(sorted(missing, key=function_count, reverse=True))


def compile_units(units: Sequence[Unit], done: Callable[[Unit], None] = lambda unit: None) -> None:
    """Compile units into the cache. A unit that fails is left to the process that will call it.

    Parameters
    ----------
    units : sequence of Unit
        Those that are not in the cache are compiled.
    done : callable
        Called with each unit that was compiled.
    """
    missing = missing_units(units)
    if not missing:
        return
    calls = [(Unit.load, (unit,)) for unit in missing]
    run_in_workers(calls, lambda number: done(missing[number]))
