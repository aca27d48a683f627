"""Start time of the program and settings of the environment that must be made before NumPy is imported."""

import os
import signal
import sys
import time
from contextlib import suppress
from types import FrameType

_RETRY_TIME = 0.02  # [s] after which an interrupt is raised again


def stop_early(*_: object) -> None:
    """Handle an interrupt while the program is still importing, where an exception would end in a traceback."""
    os.write(2, b"hvf: stopped; no partial files are left\n")
    os._exit(130)


def handle_interrupts() -> None:
    """From now on an interrupt raises KeyboardInterrupt, later if it is lost where it arrives.

    Within an import libraries turn it into other errors, and in a destructor or a callback from C it is dropped.
    """
    default_hook = sys.unraisablehook

    def raise_again(unraisable: "sys.UnraisableHookArgs") -> None:
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_TIME)
        else:
            default_hook(unraisable)

    sys.unraisablehook = raise_again
    for number in (signal.SIGINT, signal.SIGALRM):
        signal.signal(number, _interrupt)


def _interrupt(_: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            signal.setitimer(signal.ITIMER_REAL, _RETRY_TIME)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


# Not if the shell ignores the signal, nor in a worker process of this program, which imports this module late.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler and "multiprocessing" not in sys.modules:
    with suppress(ValueError):  # raised in any thread but the main one
        signal.signal(signal.SIGINT, stop_early)
for _stream in range(3):  # a file that is opened later would take the place of a closed stream, and get what is printed
    try:
        os.fstat(_stream)
    except OSError:
        os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
sys.stdout, sys.stderr = sys.stdout or open(os.devnull, "w"), sys.stderr or open(os.devnull, "w")  # noqa: SIM115
sys.stdin = sys.stdin or open(os.devnull)  # noqa: SIM115
STARTED = time.perf_counter()
"""Start of the program on `time.perf_counter` [s], from which the time to the first tick is measured."""
# The matrices are small, so that BLAS threads only slow each other down. NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# MuJoCo would load GLFW, which asks a process of its own for its version; only rendering needs a backend (`graphics`).
os.environ.setdefault("MUJOCO_GL", "disable")
