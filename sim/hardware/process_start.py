"""Starting processes that Ctrl-C does not end, and finding the parent of a process, also after it has ended."""

import multiprocessing
import os
import signal
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess


@contextmanager
def blocked_sigint() -> Generator[None]:
    """Block SIGINT until the end of the block, and for good in the processes and threads that start within it."""
    resource_tracker.ensure_running()  # otherwise spawning the first process would start it, and unblock SIGINT
    old_mask = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old_mask)


def start_without_sigint(process: BaseProcess) -> None:
    """Start a process with SIGINT blocked, also during its imports: only its parent ends it."""
    with blocked_sigint():
        process.start()


def parent_id() -> int:
    """Id of the process that started this one, as passed by it; `os.getppid` differs once that process has ended."""
    parent = multiprocessing.parent_process()
    return os.getppid() if parent is None or parent.pid is None else parent.pid
