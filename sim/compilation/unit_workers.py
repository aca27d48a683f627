"""Parallel compilation of units, in processes that import only the units' modules."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import njit, types

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
    run_in_workers(calls, lambda number: done(missing[number]), _compile_common_functions if len(missing) > 1 else None)


def _compile_common_functions() -> None:
    """Compile functions of numba that nearly all units use, before the workers are forked, so that they share them."""

    def assign(target: Any, source: Any) -> Any:
        work, rows = np.empty(3), np.zeros((2, 3))
        work[:] = source
        rows[0, :2] = source[:2]
        target[:] = work
        return max(min(work[0], rows.sum()), abs(source[1])) + len(source)

    vector = types.Array(types.float64, 1, "C")
    njit(nogil=True)(assign).compile((vector, vector))
