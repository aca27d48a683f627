"""The table of corrections: what it passes through, its derivatives, its smoothness."""

import numpy as np
import pytest

from controllers.motion.inbetween import correction, packed_table

ROWS, NODES = 40, 5
VALUES = np.random.default_rng(4).normal(size=(ROWS, NODES, NODES, 6))
TABLE = packed_table(VALUES)


def at(*place):
    d = np.empty((4, 6))
    correction(TABLE, *place, d)
    return d


@pytest.mark.parametrize(("row", "i", "j"), [(0, 0, 0), (7, 4, 4), (39, 2, 0), (20, 1, 3)])
def test_it_passes_through_its_values(row, i, j):
    np.testing.assert_allclose(at(2 * np.pi * row / ROWS, i / 4, j / 4)[0], VALUES[row, i, j], atol=1e-12)


def test_its_derivatives_agree_with_differences():
    rng, step = np.random.default_rng(1), 1e-5
    for _ in range(100):
        place = rng.uniform([0.01, 0.01, 0.01], [6.27, 0.99, 0.99])
        d = at(*place)
        for k in range(3):
            h = step * np.eye(3)[k]
            near = (at(*(place + h))[0] - at(*(place - h))[0]) / (2 * step)
            far = (at(*(place + 2 * h))[0] - at(*(place - 2 * h))[0]) / (4 * step)
            np.testing.assert_allclose((4 * near - far) / 3, d[1 + k], rtol=1e-6, atol=1e-6 * np.abs(d).max())


def test_value_and_derivatives_close_round_the_lap():
    np.testing.assert_allclose(at(2 * np.pi, 0.3, 0.6), at(0.0, 0.3, 0.6), atol=1e-9)


@pytest.mark.parametrize("way", [0, 1, 2])
def test_its_slopes_have_no_kinks_where_pieces_meet(way):
    place = np.array([2 * np.pi * 9 / ROWS, 0.5, 0.25])
    jumps = []
    for step in (1e-3, 1e-4):
        h = step * np.eye(3)[way]
        slopes = [at(*(place + k * h))[1 + way] for k in (-1, 0, 1)]
        jumps.append(np.abs(slopes[2] - 2 * slopes[1] + slopes[0]).max() / step)
    # Second derivative on both sides: their difference goes to zero with the step.
    assert jumps[1] < 0.2 * jumps[0]


def test_it_is_zero_where_its_values_are():
    values = VALUES.copy()
    values[:, 0, 0] = 0.0
    d = np.empty((4, 6))
    for angle in np.linspace(0.0, 6.28, 60):
        correction(packed_table(values), angle, 0.0, 0.0, d)
        np.testing.assert_allclose(d[:2], 0.0, atol=1e-12)


def test_values_alone_are_the_same_numbers():
    alone = np.empty((4, 6))
    correction(TABLE, 2.0, 0.3, 0.7, alone, False)
    np.testing.assert_array_equal(alone[0], at(2.0, 0.3, 0.7)[0])
    assert not alone[1:].any()
