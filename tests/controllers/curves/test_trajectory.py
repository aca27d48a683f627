"""Trajectories: interpolation, smoothness, geometry and validation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError
from tests.derivatives import central_differences

RNG = np.random.default_rng(7)


def _wxyz(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def _closed_samples(n):
    angle = np.linspace(0.0, 2.0 * np.pi, n + 1)
    ring = np.stack([0.05 * np.cos(angle), 0.04 * np.sin(2 * angle), 0.02 * np.sin(3 * angle)], axis=1)
    ring[-1] = ring[0]
    return angle, ring


def test_circle_has_exact_length_curvature_and_reach():
    circle = Trajectory.circle(0.05, 4.0, centre=(0.01, 0.0, -0.02))
    assert circle.length == pytest.approx(2.0 * np.pi * 0.05, abs=1e-7)
    assert circle.curvature(np.linspace(0, 4, 50)) == pytest.approx(20.0, rel=1e-3)
    assert circle.reach == pytest.approx(0.05, rel=2e-3)
    t = np.linspace(0.0, 4.0, 301)
    assert np.abs(np.linalg.norm(circle.point(t) - [0.01, 0.0, -0.02], axis=1) - 0.05).max() < 5e-8
    np.testing.assert_allclose(np.linalg.norm(circle.velocity(t), axis=1), 2.0 * np.pi * 0.05 / 4.0, rtol=1e-4)


def test_reach_is_half_the_gap_between_two_strands():
    x = np.linspace(-0.05, 0.05, 30)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 12)[1:-1]
    right = np.stack([0.05 + 0.004 * np.cos(turn), 0.004 * np.sin(turn)], axis=1)
    plane = np.vstack([np.stack([x, 0 * x - 0.004], 1), right, np.stack([x[::-1], 0 * x + 0.004], 1)])
    times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plane, axis=0), axis=1))])
    curve = Trajectory(times, np.column_stack([plane, 0 * times]))
    assert 0.003 < curve.reach < 0.0041


@pytest.mark.parametrize("periodic", [False, True])
def test_position_and_orientation_are_twice_continuously_differentiable(periodic):
    t, points = _closed_samples(12)
    turns = _wxyz(Rotation.from_rotvec(np.outer(np.sin(t), [0.4, 0.2, -0.5])))
    curve = Trajectory(t, points, turns, periodic=periodic)
    breaks = t[1:-1] if not periodic else t
    step = 1e-4
    for values in (curve.point, curve.orientation):
        # One-sided differences: a jump of the second derivative stays, the third derivative fades with the step.
        left = values(breaks - 2 * step) - 2.0 * values(breaks - step) + values(breaks)
        right = values(breaks + 2 * step) - 2.0 * values(breaks + step) + values(breaks)
        assert np.abs(right - left).max() / step**2 < 20 * step * np.abs(left / step**2).max() + 1e-6


def test_derivatives_match_finite_differences():
    t, points = _closed_samples(12)
    curve = Trajectory(t, points, periodic=True)
    phases = np.linspace(0.1, 6.0, 37)
    by_point, by_velocity, by_arc_length = (
        central_differences(lambda h, function=function: function(phases + h), 0.0, 1e-5)
        for function in (curve.point, curve.velocity, curve.arc_length)
    )
    np.testing.assert_allclose(curve.velocity(phases), by_point, atol=1e-8)
    np.testing.assert_allclose(curve.acceleration(phases), by_velocity, atol=1e-6)
    np.testing.assert_allclose(by_arc_length, np.linalg.norm(curve.velocity(phases), axis=1), rtol=2e-5)


def test_curve_passes_through_its_samples():
    t, points = _closed_samples(12)
    turns = _wxyz(Rotation.from_rotvec(np.outer(np.sin(t), [0.4, 0.2, -0.5])))
    scrambled = turns * RNG.choice([-1.0, 1.0], size=13)[:, None]
    curve = Trajectory(t, points, scrambled, periodic=True)
    np.testing.assert_allclose(curve.point(t), points, atol=1e-15)
    assert np.abs(np.abs((curve.orientation(t) * turns).sum(axis=1)) - 1.0).max() < 1e-12


def test_orientation_that_turns_once_per_lap_closes_smoothly():
    t, points = _closed_samples(24)
    curve = Trajectory(t, points, _wxyz(Rotation.from_rotvec(np.outer(t, [0.0, 0.0, 1.0]))), periodic=True)
    h = 1e-4
    before, at, after = curve.orientation(np.array([2 * np.pi - h, 2 * np.pi - 1e-12, 2 * np.pi + h]))
    # The sign may change at the seam; the rotation and its rate may not.
    rate = [np.linalg.norm(Rotation.from_quat(np.roll(q, -1)).as_matrix()) for q in (before, at, after)]
    assert rate == pytest.approx([np.sqrt(3.0)] * 3)
    turn = [2.0 * np.arccos(min(1.0, abs(float(a @ b)))) for a, b in ((before, at), (at, after))]
    assert turn == pytest.approx([h, h], rel=1e-3)


def test_open_curve_holds_its_ends_and_clamped_curve_rests_there():
    curve = Trajectory([0.0, 1.0, 2.0], [[0, 0, 0], [0.01, 0.02, 0], [0.05, 0, 0]], ends="clamped")
    np.testing.assert_array_equal(curve.point([-1.0, 5.0]), curve.point([0.0, 2.0]))
    np.testing.assert_allclose(curve.velocity([0.0, 2.0]), 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("times", "positions", "options", "message"),
    [
        ([0.0], [[0, 0, 0]], {}, "at least 2 samples, got 1"),
        ([0.0, 1.0, 2.0], [[0, 0, 0], [1, 0, 0], [0, 0, 0]], {"periodic": True}, "at least 4 samples, got 3"),
        ([0.0, 1.0], [[0, 0, 0], [0, 0, 0]], {}, "length"),
        ([0.0, 1.0], [[0, 0, 0], [np.nan, 0, 0]], {}, "sample 1 is not"),
        ([0.0, 1.0, 1.0], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], {}, "must increase"),
        ([0.0, 1.0], [[0, 0], [1, 0]], {}, r"shape \(2, 3\), got \(2, 2\)"),
        ([0.0, 1.0, 2.0, 3.0], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0.1]], {"periodic": True}, "gap is 0.1 m"),
        ([0.0, 1.0], [[0, 0, 0], [1, 0, 0]], {"quaternions": [[1, 0, 0, 0], [2, 0, 0, 0]]}, "unit length"),
        ([0.0, 1.0], [[0, 0, 0], [1, 0, 0]], {"quaternions": [[1, 0, 0, 0], [0, 1, 0, 0]]}, "turns 180°"),
    ],
)
def test_invalid_samples_raise_curve_error(times, positions, options, message):
    with pytest.raises(CurveError, match=message):
        Trajectory(times, positions, **options)


@settings(max_examples=50)
@given(st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=2, max_size=10), st.floats(1e-6, 10.0))
def test_any_samples_with_positive_length_give_finite_values(samples, spacing):
    positions = np.array(samples)
    if np.linalg.norm(np.diff(positions, axis=0), axis=1).sum() < 1e-6:
        positions[-1, 0] += 0.01
    curve = Trajectory(spacing * np.arange(len(positions)), positions)
    t = np.linspace(curve.start, curve.end, 50)
    for value in (curve.point(t), curve.velocity(t), curve.acceleration(t), curve.orientation(t), curve.packed()):
        assert np.isfinite(value).all()
    assert curve.length >= np.linalg.norm(positions[-1] - positions[0]) - 1e-12
