"""Arrays that are borrowed: references are not counted."""

import sys
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.borrowed import borrowed
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


FILLED = [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0]]


def test_what_is_borrowed_is_written_in_place_and_no_reference_is_lost():
    these = parts()
    counts = [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])]
    for _ in range(100):
        _filled(these, 3)
    np.testing.assert_array_equal(these.given, FILLED)
    assert [sys.getrefcount(these.given), sys.getrefcount(these.pair[0])] == counts
