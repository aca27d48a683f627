"""C functions called from compiled code, compiled functions called from C, and Python's clock for both."""

import ctypes
import time
from pathlib import Path

import numpy as np
import pytest
from numba import njit, types

from sim.compilation.c_function import address_for_c, address_of, call_int, call_void, struct_heads
from sim.compilation.compiled import entry_point
from sim.compilation.memory_access import number_at
from sim.compilation.python_clock import clock_for_c, seconds
from tests.devices.firmware import compile_c

head, hidden_head = struct_heads(False), struct_heads(True)


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    return ctypes.CDLL(str(compile_c(tmp_path_factory.mktemp("c"), Path(__file__).parent / "c_functions.c")))


@njit
def call_total(function: int, numbers: np.ndarray) -> int:
    return call_int(
        function, (np.int32(-3), np.int32(200), 7.5, np.uint32(1000), numbers.ctypes.data, np.int64(100_000))
    )


@njit
def call_keep(function: int) -> None:
    call_void(function, (1.0, 2.0, 3.0, np.int32(-2)))


@njit
def codes(give: int, hidden: int) -> tuple[int, int]:
    return head(give), hidden_head(hidden)


@entry_point
def twice(place: int) -> np.uint32:
    return np.uint32(2.0 * number_at(place))


def test_arguments_of_all_types_are_passed_by_value(library) -> None:
    assert call_total(address_of(library.total), np.array([30_000.0])) == -3 + 200 + 7 + 1000 + 30_000 + 100_000
    call_keep(address_of(library.keep))
    library.kept_numbers.restype = ctypes.POINTER(ctypes.c_double)
    assert library.kept_numbers()[:3] == [-2.0, -4.0, -6.0]


def test_first_struct_field_is_returned_in_registers_and_by_hidden_pointer(library) -> None:
    assert codes(address_of(library.give), address_of(library.give_hidden)) == (0xC0DE, 0xC0DE)


def test_c_calls_a_compiled_function(library) -> None:
    numbers = np.array([21.0])
    library.ask.argtypes, library.ask.restype = [ctypes.c_void_p, ctypes.c_void_p], ctypes.c_uint
    assert library.ask(address_for_c(twice, types.uint32(types.intp)), numbers.ctypes.data) == 42


def test_compiled_clock_equals_perf_counter_and_other_clocks_are_called() -> None:
    clock = clock_for_c(time.perf_counter)
    assert seconds(address_of(clock)) > 0.0  # compiled
    before = time.perf_counter()
    now = seconds(address_of(clock))
    assert before <= now <= time.perf_counter()
    other = clock_for_c(lambda: 12.5)
    assert seconds(address_of(other)) == 12.5
