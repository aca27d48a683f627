"""Work arrays of compiled kernels: on the stack, each its own, whatever else the kernel calls."""

import numpy as np
from numba import njit
from numba.core.runtime import _nrt_python, rtsys

from controllers.work_array import work_array, work_integers

ROWS = 3


@njit
def _filled(into: np.ndarray, value: float) -> float:
    """Uses the stack below its caller's."""
    own = work_array(64)
    for i in range(64):
        own[i] = value
    for i in range(into.shape[0]):
        into[i] = value
    return own[63]


@njit
def weighed(n: int, turns: int) -> float:
    kept, counts = work_array((n, 2)), work_integers(4)
    for i in range(n):
        kept[i, 0], kept[i, 1] = i, -i
    counts[:] = 7
    total = 0.0
    for k in range(turns):
        again = work_array((ROWS, 5))  # of constant size: one place, however often
        for row in again:
            total += _filled(row, float(k))
        total += again[0, 0] + again[ROWS - 1, 4]
    for i in range(n):
        total += 10.0 * kept[i, 0] + kept[i, 1]
    return total + counts.sum() + kept.shape[0]


def test_compiled_and_in_python_a_kernel_with_work_arrays_gives_the_same() -> None:
    assert weighed(6, 50) == weighed.py_func(6, 50) == 3 * 1225 + 2 * 1225 + 9 * 15 + 28 + 6


def test_work_arrays_take_nothing_from_the_heap_and_no_more_stack_in_each_turn() -> None:
    weighed(6, 1)
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats().alloc
        weighed(6, 1_000_000)  # as many places would be 120 MB
        assert rtsys.get_allocation_stats().alloc == before
    finally:
        _nrt_python.memsys_disable_stats()


def test_an_array_that_is_empty_is_empty() -> None:
    @njit
    def size(n: int) -> int:
        return work_array((4, n)).size + work_array((0, 3)).shape[1]

    assert size(0) == 3
