"""Parallel function calls in worker processes, which release their memory when they end.

One process is started that reads the calls from its standard input, forks a worker for each, and writes a line for each
that is done. So the workers have imported only the modules of the called functions and share no state with the run, and
the way in which the calling program was started does not matter.
"""

import gc
import multiprocessing
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

_MAX_WORKERS = 4  # each needs 200 MB and more
_ROOT = Path(__file__).resolve().parents[2]

Call = tuple[Callable[..., object], tuple[Any, ...]]


def run_in_workers(calls: Sequence[Call], done: Callable[[int], None] = lambda number: None) -> None:
    """Make calls in parallel for their side effects, such as filling a cache. Failures are ignored.

    A caller that repeats a failed call gets its exception.

    Parameters
    ----------
    calls : sequence of (function, arguments)
        Functions of modules, with arguments that can be pickled.
    done : callable
        Called with the number of each call that succeeded.
    """
    # Use the sources of this project, whatever the working directory is.
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        [sys.executable, "-P", "-m", __name__],
        env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps(calls))
        process.stdin.close()
        for line in process.stdout:
            done(int(line))


def processors() -> int:
    """Largest number of calls that are made at a time."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2
    return min(_MAX_WORKERS, available)


def _make_call(numbered: tuple[int, Call]) -> tuple[int, bool]:
    number, (function, arguments) = numbered
    try:
        with redirect_stdout(sys.stderr):  # standard output is reserved for the numbers of finished calls
            function(*arguments)
    except Exception:
        return number, False
    return number, True


def _run_calls(calls: Sequence[Call]) -> None:
    start_methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("fork" if "fork" in start_methods else "spawn")
    gc.freeze()  # keeps the pages of imported modules shared between the workers
    with context.Pool(min(len(calls), processors()), maxtasksperchild=1) as pool:
        for number, succeeded in pool.imap_unordered(_make_call, enumerate(calls)):
            if succeeded:
                print(number, flush=True)


if __name__ == "__main__":
    _run_calls(pickle.load(sys.stdin.buffer))
