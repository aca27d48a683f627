"""Calls with stored arguments: the same result as the direct call, without allocations."""

import gc
import weakref
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from geometry.arrays import Array
from sim.compilation.bound_call import BoundCall
from sim.compilation.compiled import entry_point


class Parts(NamedTuple):
    numbers: Array
    factor: float


@entry_point
def add(parts: Parts, number: int, twice: bool, into: Array) -> None:
    if number < 0:
        raise ValueError("no such number")
    for i in range(len(into)):
        into[i] += parts.factor * parts.numbers[i] * number * (2.0 if twice else 1.0)


def test_call_equals_the_direct_call_and_allocates_nothing() -> None:
    parts, into, other = Parts(np.arange(5.0), 3.0), np.zeros(5), np.zeros(5)
    number = np.array([7.0])
    call = BoundCall(add, (parts,), number, (True, into))
    add(parts, 7, True, other)
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        call()
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    np.testing.assert_array_equal(into, other)
    assert (after.alloc, after.free) == (before.alloc, before.free)
    parts.numbers[:] = 1.0
    number[0] = 1.0
    call()
    np.testing.assert_array_equal(into, other + 6.0)


def test_exceptions_of_the_function_are_raised() -> None:
    call = BoundCall(add, (Parts(np.zeros(2), 1.0),), np.array([-1.0]), (False, np.zeros(2)))
    with pytest.raises(ValueError, match="no such number"):
        call()


@pytest.mark.slow
def test_arguments_live_exactly_as_long_as_the_call() -> None:
    into = np.zeros(3)
    reference = weakref.ref(into)
    call = BoundCall(add, (Parts(np.ones(3), 1.0),), np.array([2.0]), (False, into))
    del into
    gc.collect()
    call()
    np.testing.assert_array_equal(reference(), 2.0)
    del call
    gc.collect()
    assert reference() is None
