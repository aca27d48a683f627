"""Arrays that are borrowed, and tuples that are lent to kernels called by their address."""

import sys
from typing import Any, NamedTuple

import numpy as np
from numba import njit, typeof, types

from controllers.borrowed import borrowed
from controllers.kernel_call import address_of, call_as_given, lend, lent
from controllers.state import Array


class Parts(NamedTuple):
    given: Array
    pair: tuple[Array, float]


def parts() -> Parts:
    return Parts(np.zeros((3, 2)), (np.array([1.0, 2.0]), 0.5))


@njit
def _fill(these: Parts, n: int) -> None:
    for k in range(n):
        these.given[k] = these.pair[0]
        these.given[k, 1] += k * these.pair[1]


@njit
def _filled(these: Parts, n: int) -> None:
    _fill(borrowed(these), n)


@njit
def _lent_fill(place: Any) -> None:
    these, n = lent(place)
    _fill(these, n)


@njit
def _lends(kernel: int, these: Parts) -> None:
    call_as_given(kernel, (lend((these, 3)),))


FILLED = [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0]]


def test_what_is_borrowed_is_written_in_place_and_no_reference_is_lost():
    these = parts()
    counts = [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])]
    for _ in range(100):
        _filled(these, 3)
    np.testing.assert_array_equal(these.given, FILLED)
    assert [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])] == counts


def test_a_kernel_finds_what_it_is_lent():
    these = parts()
    counts = [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])]
    kernel = address_of(_lent_fill, (types.CPointer(types.Tuple((typeof(these), types.int64))),))
    for _ in range(100):
        _lends(kernel, these)
    np.testing.assert_array_equal(these.given, FILLED)
    assert [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])] == counts
