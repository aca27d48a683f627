"""Units compiled side by side, in processes that give back the memory that a compiler takes.

`compile_units` starts one process, which reads the units from its input, forks a worker for each and writes a line for
each as it is done. So what compiles has imported nothing but the units' modules, and knows nothing of a run.
"""

import gc
import multiprocessing
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, types

from sim.compilation.unit_key import reached_functions
from sim.compilation.units import Unit, unit_function

_MOST_WORKERS = 4  # each takes some 200 MB
_ROOT = Path(__file__).resolve().parents[2]


def missing_units(units: Sequence[Unit]) -> tuple[Unit, ...]:
    """Those that are not kept, the largest first."""
    missing = [unit for unit in dict.fromkeys(units) if not unit.is_kept()]
    return tuple(sorted(missing, key=_size, reverse=True))


def compile_units(units: Sequence[Unit], done: Callable[[Unit], None] = lambda unit: None) -> None:
    """Compile units, which are then kept. One that cannot be is left to the process that will call it.

    Parameters
    ----------
    units : sequence of Unit
        Those that are not kept are compiled.
    done : callable
        Called after each that was compiled.
    """
    missing = missing_units(units)
    if not missing:
        return
    # The same sources as here, wherever this process was started.
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        [sys.executable, "-P", "-m", __name__], env=os.environ | {"PYTHONPATH": path},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps(missing))
        process.stdin.close()
        for line in process.stdout:
            done(missing[int(line)])


def _size(unit: Unit) -> int:
    return len(reached_functions(unit_function(unit.module, unit.name).py_func))


def _type_common_parts() -> None:
    """Compile what nearly all units have in them of numba's own, so that the workers begin with it."""

    def assign(target: Any, source: Any) -> Any:
        work, rows = np.empty(3), np.zeros((2, 3))
        work[:] = source
        rows[0, :2] = source[:2]
        target[:] = work
        return max(min(work[0], rows.sum()), abs(source[1])) + len(source)

    vector = types.Array(types.float64, 1, "C")
    njit(nogil=True)(assign).compile((vector, vector))


def _compile(task: tuple[int, Unit]) -> tuple[int, bool]:
    number, unit = task
    try:
        unit.load()
    except Exception:
        return number, False
    return number, True


def _work(units: Sequence[Unit]) -> None:
    ways = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("fork" if "fork" in ways else "spawn")
    workers = min(len(units), _MOST_WORKERS, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2)
    if len(units) > 1:
        _type_common_parts()
    gc.freeze()  # what is imported stays shared between the workers
    with context.Pool(workers, maxtasksperchild=1) as pool:
        for number, compiled in pool.imap_unordered(_compile, enumerate(units)):
            if compiled:
                print(number, flush=True)


if __name__ == "__main__":
    _work(pickle.load(sys.stdin.buffer))
