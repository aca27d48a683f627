"""Ctrl-C while CasADi computes."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def raise_lost_interrupts() -> Generator[None]:
    """Raise, at the end of the block, a KeyboardInterrupt that was lost within it.

    CasADi checks for signals while it evaluates, and throws. IPOPT stops then, but reports an ordinary failure to find
    a solution; and code that generates derivatives tries another method. By then Python has lost the signal.

    Raises
    ------
    KeyboardInterrupt
        If SIGINT arrived in the main thread and Python handles it.
    """
    previous_handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous_handler):
        yield
        return
    interrupted = threading.Event()

    def record_interrupt(number: int, frame: FrameType | None) -> None:
        interrupted.set()
        previous_handler(number, frame)

    signal.signal(signal.SIGINT, record_interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous_handler)
        if interrupted.is_set():
            raise KeyboardInterrupt
