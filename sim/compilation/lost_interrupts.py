"""Ctrl-C during a callback from C, such as a map in Python within a tick, or LLVM's cache of objects."""

import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any


@contextmanager
def reraise_lost_interrupts() -> Generator[None]:
    """Raise a KeyboardInterrupt that ctypes dropped in a callback within the block, at the end of the block.

    An interrupt during compiled code is raised where the next callback begins, before its code can catch anything;
    ctypes then drops it and only reports it to `sys.unraisablehook`.
    """
    if threading.current_thread() is not threading.main_thread():  # other threads get no signals
        yield
        return
    old_hook, lost = sys.unraisablehook, list[BaseException]()

    def keep_interrupts(unraisable: Any) -> None:
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            lost.append(unraisable.exc_value)
        else:
            old_hook(unraisable)

    sys.unraisablehook = keep_interrupts
    try:
        yield
    finally:
        sys.unraisablehook = old_hook
        if lost:
            raise lost[0]
