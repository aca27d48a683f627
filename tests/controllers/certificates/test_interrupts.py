"""Ctrl-C ends IPOPT with KeyboardInterrupt, not with a failed solution."""

import contextlib
import os
import signal
import threading
import time
from collections.abc import Generator

import casadi as ca
import pytest

from controllers.certificates.interrupts import raise_lost_interrupts


@pytest.fixture(autouse=True)
def python_handles_sigint() -> Generator[None]:
    """A background job of a shell, as CI may be, begins with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_interrupt_ends_ipopt() -> None:
    x = ca.MX.sym("x", 3000)
    cost = ca.sum1(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2) + 0.01 * ca.sum1(ca.cos(7 * x))
    options = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 100_000}
    solve, timer = ca.nlpsol("solve", "ipopt", {"x": x, "f": cost}, options), threading.Timer(0.2, _interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt), raise_lost_interrupts():
        solve(x0=0.3)  # some nine seconds without an interrupt
    timer.join()
    assert not solve.stats()["success"]


def _suppressed_interrupt() -> None:
    with contextlib.suppress(KeyboardInterrupt):
        _interrupt()
        time.sleep(1.0)


def test_interrupt_lost_within_the_block_is_raised_at_its_end() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), raise_lost_interrupts():
        _suppressed_interrupt()
    assert signal.getsignal(signal.SIGINT) is before


def test_block_without_interrupt_keeps_handler_and_exceptions() -> None:
    before = signal.getsignal(signal.SIGINT)
    with raise_lost_interrupts():
        pass
    with pytest.raises(ZeroDivisionError), raise_lost_interrupts():
        _ = 1 / 0
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_keep_the_signal_handler() -> None:
    before, handlers = signal.getsignal(signal.SIGINT), list[object]()

    def enter_block() -> None:
        with raise_lost_interrupts():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=enter_block)
    thread.start()
    thread.join()
    assert handlers == [before]
