"""Named tuples that are lent: one pointer, and fields that are read by name, in compiled code and called by address."""

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit, typeof, types
from numba.core.errors import TypingError

from controllers.kernel_call import address_of, call_as_given
from controllers.lent import Lent, lend
from controllers.state import Array


class Inner(NamedTuple):
    pair: tuple[Array, float]
    several: tuple[int, int]
    on: bool


class Same(NamedTuple):
    """Fields of one type: numba has another type for these."""

    first: float
    second: float


class Parts(NamedTuple):
    given: Array
    inner: Inner
    same: Same


class Renamed(NamedTuple):
    """The types of `Same` by other names: numba's name of the type is the same but for the class."""

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
    _fill(lend(these), n)


@njit
def _filled(these: Parts, n: int) -> None:
    _lend_on(lend(these), n)


@njit
def _by_address(kernel: int, these: Parts) -> None:
    call_as_given(kernel, (lend(these), 3))


@njit
def _difference(same: Any) -> float:
    return 10.0 * same.first + same.second


@njit
def _lent_difference(same: Any) -> float:
    return _difference(lend(same))


@njit
def _misspelt(these: Any) -> float:
    return lend(these).missing


FILLED = [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0]]


def counts(these: Parts) -> list[int]:
    return [sys.getrefcount(these.given), sys.getrefcount(these.inner.pair[0])]


def test_fields_of_a_lent_tuple_and_of_those_in_it_are_read_and_written_in_place():
    these = parts()
    before = counts(these)
    for _ in range(100):
        _filled(these, 3)
    np.testing.assert_array_equal(these.given, FILLED)
    assert counts(these) == before


def test_a_kernel_called_by_its_address_finds_what_it_is_lent():
    these = parts()
    before = counts(these)
    kernel = address_of(_fill, (Lent(typeof(these)), types.int64))
    for _ in range(100):
        _by_address(kernel, these)
    np.testing.assert_array_equal(these.given, FILLED)
    assert counts(these) == before


def test_the_same_function_takes_a_tuple_and_a_lent_one():
    these, others = parts(), parts()
    _fill(these, 3)
    _filled(others, 3)
    np.testing.assert_array_equal(these.given, others.given)


def test_fields_are_found_by_name_where_types_are_equal():
    assert _lent_difference(Same(1.0, 2.0)) == 12.0
    assert _lent_difference(Renamed(1.0, 2.0)) == 21.0
    assert Lent(typeof(Same(1.0, 2.0))) != Lent(typeof(Renamed(1.0, 2.0)))


def test_a_field_that_does_not_exist_is_an_error_of_compilation():
    with pytest.raises(TypingError, match="missing"):
        _misspelt(Same(1.0, 2.0))
