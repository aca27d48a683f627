"""Lent named tuples: one pointer, with fields read by name, in compiled code and in kernels called by address."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit, typeof, types
from numba.core.errors import TypingError

from controllers.kernel_call import address_of, call_as_given
from controllers.lent import Lent, by_pointer
from geometry.arrays import Array
from tests.controllers.array_lifetimes import ArrayLifetimes


class Inner(NamedTuple):
    pair: tuple[Array, float]
    several: tuple[int, int]
    on: bool


class Same(NamedTuple):
    """Fields of one type, for which numba has another tuple type."""

    first: float
    second: float


class Parts(NamedTuple):
    given: Array
    inner: Inner
    same: Same


class Renamed(NamedTuple):
    """The fields of `Same` in another order: numba's type names differ only by the class."""

    second: float
    first: float


def parts() -> Parts:
    return Parts(np.zeros((3, 2)), Inner((np.array([1.0, 2.0]), 0.5), (1, 0), True), Same(3.0, 4.0))


@njit
def _fill(these: Parts, n: int) -> None:
    inner = these.inner
    for k in range(n):
        these.given[k] = inner.pair[0]
        if inner.on:
            these.given[k, inner.several[0]] += k * inner.pair[1]


@njit
def _lend_on(these: Parts, n: int) -> None:
    _fill(by_pointer(these), n)


@njit
def _filled(these: Parts, n: int) -> None:
    _lend_on(by_pointer(these), n)


@njit
def _by_address(kernel: int, these: Parts) -> None:
    call_as_given(kernel, (by_pointer(these), 3))


@njit
def _difference(same: Any) -> float:
    return 10.0 * same.first + same.second


@njit
def _lent_difference(same: Any) -> float:
    return _difference(by_pointer(same))


@njit
def _misspelt(these: Any) -> float:
    return by_pointer(these).missing


FILLED = [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0]]


def test_fields_of_lent_and_nested_tuples_are_read_and_written_in_place():
    these = parts()
    arrays = ArrayLifetimes(these.given, these.inner.pair[0])
    for _ in range(100):
        _filled(these, 3)
    np.testing.assert_array_equal(these.given, FILLED)
    assert arrays.all_alive()
    del these
    assert arrays.all_freed()


def test_kernel_called_by_address_reads_lent_fields():
    these = parts()
    arrays = ArrayLifetimes(these.given, these.inner.pair[0])
    kernel = address_of(_fill, (Lent(typeof(these)), types.int64))
    for _ in range(100):
        _by_address(kernel, these)
    np.testing.assert_array_equal(these.given, FILLED)
    assert arrays.all_alive()
    del these
    assert arrays.all_freed()


def test_function_accepts_tuples_and_lent_tuples():
    these, others = parts(), parts()
    _fill(these, 3)
    _filled(others, 3)
    np.testing.assert_array_equal(these.given, others.given)


def test_fields_are_found_by_name_where_types_are_equal():
    assert _lent_difference(Same(1.0, 2.0)) == 12.0
    assert _lent_difference(Renamed(1.0, 2.0)) == 21.0
    assert Lent(typeof(Same(1.0, 2.0))) != Lent(typeof(Renamed(1.0, 2.0)))


def test_missing_field_raises_typing_error():
    with pytest.raises(TypingError, match="missing"):
        _misspelt(Same(1.0, 2.0))
