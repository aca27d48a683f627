"""Start of processes that Ctrl-C does not end, and how they see that whoever started them is gone."""

import multiprocessing
import os
import signal
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess


def start_undisturbed(process: BaseProcess) -> None:
    """Start a process with SIGINT blocked, also while it imports: whoever started it tells it when to end."""
    resource_tracker.ensure_running()  # now, since the first process that is spawned starts it, which unblocks SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def parent_id() -> int:
    """Id of the process that started this one, as it said itself; `os.getppid` is another once that one is gone."""
    parent = multiprocessing.parent_process()
    return os.getppid() if parent is None or parent.pid is None else parent.pid
