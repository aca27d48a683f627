"""The table of corrections: interpolation, derivatives and smoothness."""

import numpy as np
import pytest

from controllers.motion.inbetween import correction, packed_table
from tests.derivatives import extrapolated_differences

ROWS, NODES = 40, 5
VALUES = np.random.default_rng(4).normal(size=(ROWS, NODES, NODES, 6))
TABLE = packed_table(VALUES)


def correction_at(*position):
    d = np.empty((4, 6))
    correction(TABLE, *position, d)
    return d


@pytest.mark.parametrize(("row", "i", "j"), [(0, 0, 0), (7, 4, 4), (39, 2, 0), (20, 1, 3)])
def test_table_passes_through_its_values(row, i, j):
    np.testing.assert_allclose(correction_at(2 * np.pi * row / ROWS, i / 4, j / 4)[0], VALUES[row, i, j], atol=1e-12)


def test_derivatives_match_finite_differences():
    rng = np.random.default_rng(1)
    for _ in range(100):
        position = rng.uniform([0.01, 0.01, 0.01], [6.27, 0.99, 0.99])
        d = correction_at(*position)
        numeric = extrapolated_differences(lambda x: correction_at(*x)[0], position, 1e-5)
        np.testing.assert_allclose(numeric.T, d[1:], rtol=1e-6, atol=1e-6 * np.abs(d).max())


def test_value_and_derivatives_close_over_the_lap():
    np.testing.assert_allclose(correction_at(2 * np.pi, 0.3, 0.6), correction_at(0.0, 0.3, 0.6), atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_derivatives_have_no_kink_between_segments(axis):
    position = np.array([2 * np.pi * 9 / ROWS, 0.5, 0.25])
    jumps = []
    for step in (1e-3, 1e-4):
        h = step * np.eye(3)[axis]
        slopes = [correction_at(*(position + k * h))[1 + axis] for k in (-1, 0, 1)]
        jumps.append(np.abs(slopes[2] - 2 * slopes[1] + slopes[0]).max() / step)
    # The difference of the second derivatives on both sides goes to zero with the step.
    assert jumps[1] < 0.2 * jumps[0]


def test_correction_is_zero_where_all_values_are():
    values = VALUES.copy()
    values[:, 0, 0] = 0.0
    d = np.empty((4, 6))
    for angle in np.linspace(0.0, 6.28, 60):
        correction(packed_table(values), angle, 0.0, 0.0, d)
        np.testing.assert_allclose(d[:2], 0.0, atol=1e-12)


def test_values_without_derivatives_are_identical():
    values = np.empty((4, 6))
    correction(TABLE, 2.0, 0.3, 0.7, values, False)
    np.testing.assert_array_equal(values[0], correction_at(2.0, 0.3, 0.7)[0])
    assert not values[1:].any()
