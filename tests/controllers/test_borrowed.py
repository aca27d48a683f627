"""Borrowed arrays in compiled code: written in place, without reference counting."""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.borrowed import without_refcount
from geometry.arrays import Array
from tests.controllers.array_lifetimes import ArrayLifetimes


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
    _fill(without_refcount(these), n)


FILLED = [[1.0, 2.0], [1.0, 2.5], [1.0, 3.0]]


def test_borrowed_arrays_are_written_in_place_and_neither_freed_nor_leaked():
    these = parts()
    arrays = ArrayLifetimes(these.given, these.pair[0])
    for _ in range(100):
        _filled(these, 3)
    np.testing.assert_array_equal(these.given, FILLED)
    assert arrays.all_alive()
    del these
    assert arrays.all_freed()
