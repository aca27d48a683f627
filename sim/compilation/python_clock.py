"""`time.perf_counter` for compiled code in threads unknown to Python, by the C function behind it."""

import ctypes
import time
from collections.abc import Callable
from typing import Any

from numba import njit

from controllers.work_array import work_integers
from sim.compilation.c_function import call_int

_CLOCK_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_int64), ctypes.c_void_p)
_PERF_COUNTER_NAMES = "PyTime_PerfCounterRaw", "_PyTime_GetPerfCounterWithInfo"
"""Functions of Python's C interface, from 3.13 on and before: each writes nanoseconds to its first argument, a pointer.
The older one takes a second pointer, which may be null; the newer one takes no second argument and ignores it."""


@njit
def seconds(clock: int) -> float:
    """Time by the clock whose C function is at an address [s]."""
    buffer = work_integers(1)
    call_int(clock, (buffer.ctypes.data, 0))
    return buffer[0] / 1e9


def clock_for_c(clock: Callable[[], float]) -> Any:
    """A clock as a C function for `seconds`; keep a reference for as long as its address is used.

    `time.perf_counter` is read without the GIL. Any other clock is a Python function and takes the GIL.
    """
    if clock is time.perf_counter:
        for name in _PERF_COUNTER_NAMES:
            if hasattr(ctypes.pythonapi, name):
                return getattr(ctypes.pythonapi, name)

    def write_time(buffer: Any, _: Any) -> int:
        buffer[0] = round(clock() * 1e9)
        return 0

    return _CLOCK_FUNCTION(write_time)
