"""Kernels called by their address: the same numbers, the same errors, and nothing of them in the caller."""

import sys

import numpy as np
import pytest
from numba import njit, types

from controllers.errors import ControllerError
from controllers.kernel_call import kernel_call

VECTOR = types.Array(types.float64, 1, "C")
ARGUMENTS = (VECTOR, types.int64, VECTOR)
call = kernel_call(ARGUMENTS)


@njit
def shifting_law(values, at, out):
    if at >= values.shape[0]:
        raise ControllerError("beyond the end")
    for i in range(out.shape[0]):
        out[i] = values[at] + 0.1 * i


@njit
def mirroring_law(values, at, out):
    out[:] = -values[at]


@njit
def called(address, values, at, out):
    call(address, (values, at, out))


def address(kernel):
    kernel.compile(ARGUMENTS)
    compiled = kernel.get_compile_result(types.void(*ARGUMENTS))
    return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)


def test_the_kernel_is_chosen_by_its_address_alone():
    values, one, other = np.random.default_rng(0).normal(size=5), np.empty(4), np.empty(4)
    for kernel in (shifting_law, mirroring_law):
        called(address(kernel), values, 3, one)
        kernel(values, 3, other)
        np.testing.assert_array_equal(one, other)
    assert len(called.signatures) == 1
    assert not any(
        name in text for text in called.inspect_llvm().values() for name in ("shifting_law", "mirroring_law")
    )


def test_an_error_in_the_kernel_is_the_caller_s():
    out = np.zeros(4)
    with pytest.raises(ControllerError, match="beyond the end"):
        called(address(shifting_law), np.zeros(2), 7, out)
    assert not out.any()


def test_calls_leave_the_arrays_reference_counts_as_they_were():
    kernel, values, out = address(shifting_law), np.zeros(2), np.zeros(4)
    before = [sys.getrefcount(array) for array in (values, out)]
    for at in (0, 1) * 50:
        called(kernel, values, at, out)
    assert [sys.getrefcount(array) for array in (values, out)] == before
