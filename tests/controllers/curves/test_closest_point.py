"""The closest point of a curve is global and exact, for any initial guess."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory


@njit
def _search(blob, points, guesses):
    found = np.empty((len(points), 2))
    for i in range(len(points)):
        found[i] = closest_phase(blob, 0, points[i, 0], points[i, 1], points[i, 2], guesses[i])
    return found


def _random_curve(rng, n, periodic):
    samples = rng.normal(size=(n, 3)) * 0.05
    if periodic:
        samples = np.vstack([samples, samples[:1]])
    return Trajectory(np.cumsum(rng.uniform(0.1, 1.0, len(samples))), samples, periodic=periodic)


def _brute_force(curve, point):
    """Smallest distance on 2000 samples, the five best refined by golden section, in NumPy alone."""
    t = np.linspace(curve.start, curve.end, 2001)
    distance = np.linalg.norm(curve.point(t) - point, axis=1)
    best = np.inf
    for i in np.argsort(distance)[:5]:
        low, high = t[max(i - 1, 0)], t[min(i + 1, 2000)]
        for _ in range(60):
            a, b = low + 0.381966 * (high - low), high - 0.381966 * (high - low)
            if np.linalg.norm(curve.point(a) - point) < np.linalg.norm(curve.point(b) - point):
                high = b
            else:
                low = a
        best = min(best, float(np.linalg.norm(curve.point(0.5 * (low + high)) - point)), distance[i])
    return best


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("n", [4, 9, 40])
def test_distance_is_the_global_minimum_within_a_nanometre(n, periodic):
    rng = np.random.default_rng(n)
    curve = _random_curve(rng, n, periodic)
    points = rng.normal(size=(12, 3)) * 0.08
    found = _search(curve.packed(), points, np.full(12, np.nan))
    expected = np.array([_brute_force(curve, p) for p in points])
    np.testing.assert_allclose(np.linalg.norm(curve.point(found[:, 0]) - points, axis=1), found[:, 1], atol=1e-15)
    assert np.abs(found[:, 1] - expected).max() < 1e-9


@pytest.mark.parametrize("n", [2, 3, 30, 400])
def test_guess_does_not_change_the_distance(n):
    rng = np.random.default_rng(n)
    curve = _random_curve(rng, n, periodic=False)
    points = rng.normal(size=(500, 3)) * 0.08
    cold = _search(curve.packed(), points, np.full(500, np.nan))
    warm = _search(curve.packed(), points, rng.uniform(curve.start - 1.0, curve.end + 1.0, 500))
    assert np.abs(warm[:, 1] - cold[:, 1]).max() < 1e-10


def test_search_switches_to_the_nearer_strand_halfway_between_two():
    # Two strands 10 mm apart that the curve runs along one after the other: a tracker could stay on the wrong one.
    x = np.linspace(-0.05, 0.05, 21)
    there = np.stack([x, np.zeros(21), np.zeros(21)], axis=1)
    back = np.stack([x[::-1], np.full(21, 0.01), np.zeros(21)], axis=1)
    curve = Trajectory(np.arange(42.0), np.vstack([there, back]))
    blob, guess = curve.packed(), np.nan
    for y in np.linspace(0.0, 0.01, 101):
        guess, distance = closest_phase(blob, 0, 0.003, y, 0.0, guess)
        assert distance <= min(y, 0.01 - y) + 1e-6
    assert curve.point(guess)[1] == pytest.approx(0.01, abs=1e-6)


@pytest.mark.slow
def test_all_three_extrema_of_one_segment_are_considered():
    # One hairpin segment: near its axis the distance has two minima with a maximum between.
    curve = Trajectory([0.0, 1.0, 2.0], [[-0.01, 0.0, 0.0], [0.0, 0.05, 0.0], [0.01, 0.0, 0.0]])
    points = np.stack([np.linspace(-0.009, 0.009, 41), np.full(41, 0.02), np.zeros(41)], axis=1)
    for guess in (0.1, 1.9):
        found = _search(curve.packed(), points, np.full(41, guess))
        expected = np.array([_brute_force(curve, p) for p in points])
        assert np.abs(found[:, 1] - expected).max() < 1e-9


@settings(max_examples=60)
@given(
    st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=2, max_size=8),
    st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    st.floats(1e-9, 1.0),
)
def test_degenerate_samples_give_the_minimum_distance(samples, point, squeeze):
    positions = np.array(samples) * [1.0, squeeze, squeeze]
    if np.linalg.norm(np.diff(positions, axis=0), axis=1).sum() < 1e-6:
        positions[-1] += [0.01, 0.0, 0.0]
    curve = Trajectory(np.arange(len(positions), dtype=float), positions)
    _, distance = closest_phase(curve.packed(), 0, *point, np.nan)
    dense = np.linalg.norm(curve.point(np.linspace(curve.start, curve.end, 4001)) - np.array(point), axis=1).min()
    # The tolerance that `closest_phase` documents; a curve of a micrometre uses half of it.
    assert distance <= dense + 1e-11
    assert distance >= dense - 0.01 * curve.length - 1e-12


def test_centre_of_a_circle_gives_its_radius():
    curve = Trajectory.circle(0.05, 4.0)
    phase, distance = closest_phase(curve.packed(), 0, 0.0, 0.0, 0.0, 1.0)
    assert distance == pytest.approx(0.05, abs=1e-8)
    assert curve.start <= phase <= curve.end


@pytest.mark.parametrize("point", [(1e6, 0.0, 0.0), (1e120, -1e120, 0.0)])
def test_distance_to_a_far_point_is_finite_and_exact(point):
    curve = Trajectory.circle(0.05, 4.0)
    phase, distance = closest_phase(curve.packed(), 0, *point, np.nan)
    assert np.isfinite(phase)
    assert distance == pytest.approx(np.linalg.norm(point), rel=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_point_gives_nan_distance(bad):
    _, distance = closest_phase(Trajectory.circle(0.05, 4.0).packed(), 0, bad, 0.0, 0.0, 0.5)
    assert np.isnan(distance)
