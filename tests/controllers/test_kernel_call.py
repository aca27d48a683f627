"""Kernels called by their address: same values, same errors, and a caller compiled without their code."""

import numpy as np
import pytest
from numba import njit, types
from numba.core.caching import NullCache

from controllers.errors import ControllerError
from controllers.kernel_call import kernel_call
from tests.controllers.array_lifetimes import ArrayLifetimes

VECTOR = types.Array(types.float64, 1, "C")
ARGUMENTS = (VECTOR, types.int64, VECTOR)
call = kernel_call(ARGUMENTS)


@njit
def shifting_law(values, index, out):
    if index >= values.shape[0]:
        raise ControllerError("beyond the end")
    for i in range(out.shape[0]):
        out[i] = values[index] + 0.1 * i


@njit
def mirroring_law(values, index, out):
    out[:] = -values[index]


@njit
def call_by_address(address, values, index, out):
    call(address, (values, index, out))


def address(kernel):
    kernel.compile(ARGUMENTS)
    compiled = kernel.get_compile_result(types.void(*ARGUMENTS))
    return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)


class Uncached(NullCache):
    """No cache, and none given by conftest either: numba does not show the code of a function from a cache."""


def compiled_code(function, arguments):
    """LLVM code of a function, compiled anew."""
    anew = njit(function)
    anew._cache = Uncached()
    anew.compile(arguments)
    (code,) = anew.inspect_llvm().values()
    return code


def test_kernel_is_called_by_its_address_alone():
    values, one, other = np.random.default_rng(0).normal(size=5), np.empty(4), np.empty(4)
    for kernel in (shifting_law, mirroring_law):
        call_by_address(address(kernel), values, 3, one)
        kernel(values, 3, other)
        np.testing.assert_array_equal(one, other)
    assert len(call_by_address.signatures) == 1
    by_address = compiled_code(call_by_address.py_func, (types.int64, *ARGUMENTS))
    by_name = compiled_code(lambda values, index, out: mirroring_law(values, index, out), ARGUMENTS)
    assert ("mirroring_law" in by_name, "mirroring_law" in by_address, "shifting_law" in by_address) == (
        True, False, False,
    )  # fmt: skip


def test_error_in_the_kernel_is_raised_in_the_caller():
    out = np.zeros(4)
    with pytest.raises(ControllerError, match="beyond the end"):
        call_by_address(address(shifting_law), np.zeros(2), 7, out)
    assert not out.any()


def test_calls_neither_free_nor_leak_arrays():
    kernel, values, out = address(shifting_law), np.zeros(2), np.zeros(4)
    arrays = ArrayLifetimes(values, out)
    for index in (0, 1) * 50:
        call_by_address(kernel, values, index, out)
    assert arrays.all_alive()
    del values, out
    assert arrays.all_freed()
