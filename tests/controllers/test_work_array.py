"""Work arrays of compiled kernels: distinct arrays on the stack that called functions do not overwrite."""

import numpy as np
from numba import njit
from numba.core.runtime import _nrt_python, rtsys

from controllers.work_array import work_array, work_integers

ROWS = 3


@njit
def _filled(into: np.ndarray, value: float) -> float:
    """Fills a work array of its own, on the stack below its caller's."""
    own = work_array(64)
    for i in range(64):
        own[i] = value
    for i in range(into.shape[0]):
        into[i] = value
    return own[63]


@njit
def weighted_sum(n: int, turns: int) -> float:
    rows, counts = work_array((n, 2)), work_integers(4)
    for i in range(n):
        rows[i, 0], rows[i, 1] = i, -i
    counts[:] = 7
    total = 0.0
    for k in range(turns):
        block = work_array((ROWS, 5))  # of constant size: the same memory in each turn
        for row in block:
            total += _filled(row, float(k))
        total += block[0, 0] + block[ROWS - 1, 4]
    for i in range(n):
        total += 10.0 * rows[i, 0] + rows[i, 1]
    return total + counts.sum() + rows.shape[0]


def test_kernel_with_work_arrays_equals_python() -> None:
    assert weighted_sum(6, 50) == weighted_sum.py_func(6, 50) == 3 * 1225 + 2 * 1225 + 9 * 15 + 28 + 6


def test_work_arrays_use_no_heap_and_constant_stack() -> None:
    weighted_sum(6, 1)
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats().alloc
        weighted_sum(6, 1_000_000)  # separate arrays would take 120 MB
        assert rtsys.get_allocation_stats().alloc == before
    finally:
        _nrt_python.memsys_disable_stats()


def test_empty_work_array_has_size_zero() -> None:
    @njit
    def size(n: int) -> int:
        return work_array((4, n)).size + work_array((0, 3)).shape[1]

    assert size(0) == 3
