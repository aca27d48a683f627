"""Calls side by side, in processes that give back the memory that they take.

One process is started, which reads the calls from its input, forks a worker for each and writes a line for each as it
is done. So the workers have imported nothing but what is called, and know nothing of a run; nor does it matter how the
program began that asks for them.
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

_MOST_WORKERS = 4  # each takes 200 MB and more
_ROOT = Path(__file__).resolve().parents[2]

Call = tuple[Callable[..., object], tuple[Any, ...]]


def side_by_side(
    calls: Sequence[Call], done: Callable[[int], None] = lambda number: None, first: Callable[[], None] | None = None
) -> None:
    """Make calls for what they keep. One that fails is left to whoever makes it again, and learns why.

    Parameters
    ----------
    calls : sequence of (function, arguments)
        Functions of modules, and what can be pickled.
    done : callable
        Called with the number of each that ended well.
    first : callable or None
        A function of a module that is called once, before the workers are forked.
    """
    # The same sources as here, wherever this process was started.
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        [sys.executable, "-P", "-m", __name__],
        env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps((calls, first)))
        process.stdin.close()
        for line in process.stdout:
            done(int(line))


def processors() -> int:
    """How many calls are made at a time, at most."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2
    return min(_MOST_WORKERS, available)


def _made(numbered: tuple[int, Call]) -> tuple[int, bool]:
    number, (function, arguments) = numbered
    try:
        with redirect_stdout(sys.stderr):  # the output is for numbers
            function(*arguments)
    except Exception:
        return number, False
    return number, True


def _work(calls: Sequence[Call], first: Callable[[], None] | None) -> None:
    ways = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("fork" if "fork" in ways else "spawn")
    if first is not None:
        first()
    gc.freeze()  # what is imported stays shared between the workers
    with context.Pool(min(len(calls), processors()), maxtasksperchild=1) as pool:
        for number, well in pool.imap_unordered(_made, enumerate(calls)):
            if well:
                print(number, flush=True)


if __name__ == "__main__":
    _work(*pickle.load(sys.stdin.buffer))
