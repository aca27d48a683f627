"""Ctrl-C while CasADi works."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def heeding_interrupts() -> Generator[None]:
    """Raise, at the end of the block, a KeyboardInterrupt that has been lost within it.

    CasADi looks for signals while it evaluates and throws, which stops IPOPT; but IPOPT reports it as one more way not
    to find a solution, and the making of derivatives tries another way: Python has forgotten the signal by then.

    Raises
    ------
    KeyboardInterrupt
        If SIGINT came and is handled by Python, in the main thread.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    came = threading.Event()

    def noted(number: int, frame: FrameType | None) -> None:
        came.set()
        before(number, frame)

    signal.signal(signal.SIGINT, noted)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came.is_set():
            raise KeyboardInterrupt
