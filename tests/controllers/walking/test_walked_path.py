"""The path that grows at its front: arc length, smoothness, turning, overwriting of old rows, and leaning."""

import numpy as np
import pytest

from controllers.walking.walked_path import (
    PACKED_PATH,
    PATH_HEADING,
    PATH_LEAN,
    PATH_X,
    PATH_Y,
    ROWS,
    STEP,
    lay_row,
    lean_row,
    path_back,
    path_front,
    path_value,
    straight_path,
)
from geometry.physics import GRAVITY


def _values(path, arguments, channel):
    return np.array([path_value(path, float(s), channel) for s in arguments]).T


def _winding(rows=400):
    path = straight_path(1.0, -2.0, 0.4, 0.5)
    for k in range(rows):
        lay_row(path, 0.8 * STEP * np.sin(0.05 * k), 0.8, 0.0)
    return path


def test_path_is_parametrised_by_arc_length_along_its_heading():
    path = _winding()
    arguments = np.linspace(0.0, path_front(path), 3000)
    (_, d_x), (_, d_y), (heading, _) = (_values(path, arguments, k) for k in (PATH_X, PATH_Y, PATH_HEADING))
    # Of second order in κΔ = 0.024.
    np.testing.assert_allclose(np.hypot(d_x, d_y), 1.0, atol=2e-4)
    np.testing.assert_allclose(np.exp(1j * heading), d_x + 1j * d_y, atol=4e-4)


@pytest.mark.parametrize("channel", [PATH_X, PATH_Y, PATH_HEADING])
def test_derivative_matches_one_sided_differences_at_the_rows(channel):
    path = _winding()
    arguments, h = np.arange(0.0, 9.0, STEP), 1e-5
    before, at, after = (_values(path, arguments + d, channel) for d in (-h, 0.0, h))
    # At the rows, where segments meet: one-sided differences on both sides.
    np.testing.assert_allclose((at[0] - before[0]) / h, at[1], atol=2e-5)
    np.testing.assert_allclose((after[0] - at[0]) / h, at[1], atol=2e-5)


def test_row_turns_the_path_over_three_steps_only():
    path = straight_path(0.0, 0.0, 0.7, 0.1)
    row = int(path[0])
    lay_row(path, 0.1, 0.0, 0.0)
    for _ in range(10):
        lay_row(path, 0.0, 0.0, 0.0)
    heading = _values(path, np.array([0.0, (row - 1) * STEP, (row + 2) * STEP, (row + 6) * STEP]), PATH_HEADING)
    np.testing.assert_array_equal(heading[1], 0.0)
    np.testing.assert_allclose(heading[0], [0.7, 0.7, 0.8, 0.8], atol=1e-15)
    assert path_value(path, (row + 0.5) * STEP, PATH_HEADING)[1] > 1.0


def test_oldest_rows_are_overwritten_and_the_rest_is_unchanged():
    path = _winding(500)
    argument = 14.0
    before = [path_value(path, argument, k) for k in (PATH_X, PATH_Y, PATH_HEADING)]
    while path_back(path) < argument - STEP:
        lay_row(path, 0.0, 0.0, 0.0)
    assert [path_value(path, argument, k) for k in (PATH_X, PATH_Y, PATH_HEADING)] == before
    assert len(path) == PACKED_PATH
    assert path_front(path) - path_back(path) == pytest.approx((ROWS - 4) * STEP)
    # Beyond both ends the path stays where it ends.
    for end, beyond in ((path_front(path), 1.0), (path_back(path), -1.0)):
        assert path_value(path, end + beyond, PATH_X)[0] == path_value(path, end, PATH_X)[0]


def test_lean_solves_the_pendulum_equation_and_starts_before_a_bend():
    rate, speed, back = np.sqrt(GRAVITY), 1.2, 80
    decay = np.exp(-STEP * rate / speed)
    path, state = straight_path(0.0, 0.0, 0.0, 0.1), 0.0
    accelerations = np.where((np.arange(400) > 150) & (np.arange(400) < 250), 0.4, 0.0)
    first = int(path[0]) + 1
    for acceleration in accelerations:
        lay_row(path, 0.0, 0.0, acceleration)
        state = lean_row(path, back, decay, state)
    lean = _values(path, (first + np.arange(20, 300)) * STEP, PATH_LEAN)[0]
    # y'' = ω² (y − h a/g) with y = h tan φ and h = 1 m: an inverted pendulum whose base is accelerated by a.
    y, dt = np.tan(lean), STEP / speed
    bend = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / dt**2
    # Away from the jumps of the acceleration, which the splines smooth.
    rows = np.arange(21, 299)
    even = np.minimum(np.abs(rows - 150.5), np.abs(rows - 249.5)) > 2.0
    expected = rate**2 * (y[1:-1] - accelerations[21:299] / GRAVITY)
    np.testing.assert_allclose(bend[even], expected[even], atol=0.02 * 0.4)
    # Ten rows before the bend the lean has begun.
    assert lean[120] > 0.2 * lean.max()
