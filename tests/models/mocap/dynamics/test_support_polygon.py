"""The support polygon: against the definition of the nearest point of a convex set, and against a convex hull."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from models.mocap.dynamics.zero_moment_point import nearest_supported

FLOOR = np.array([(-0.05, 0.1), (0.16, 0.1), (-0.05, -0.1), (0.16, -0.1)])
ALL = np.ones(4, dtype=bool)


@settings(max_examples=50)
@given(
    corners=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=1, max_size=8),
    point=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_nearest_supported_point_is_the_projection_onto_the_convex_hull(corners, point):
    # Two of the last, since an edge needs two corners.
    contacts = np.array([*corners, corners[-1]])
    nearest = nearest_supported(np.array(point), contacts, np.ones(len(contacts), dtype=bool), 1.0)
    # Of a convex set, n is the point nearest to p exactly if no corner lies beyond the line through n across p − n ...
    assert np.max((contacts - nearest) @ (np.array(point) - nearest)) <= 1e-7
    # ... and n belongs to the set: no direction has it beyond every corner.
    directions = np.stack([np.cos(a := np.linspace(0, 2 * np.pi, 73)), np.sin(a)])
    assert np.all(nearest @ directions <= (contacts @ directions).max(axis=0) + 1e-7)


def test_points_are_unchanged_exactly_if_inside_the_shrunk_convex_hull():
    rng = np.random.default_rng(0)
    contacts, touching = rng.uniform(-0.2, 0.2, (40, 8, 2)), np.arange(8) < rng.integers(3, 9, (40, 1))
    points = rng.uniform(-0.1, 0.1, (40, 2))
    unchanged = np.all(nearest_supported(points, contacts, touching, 0.8) == points, axis=1)
    inside = []
    for point, feet in zip(points, (c[t] for c, t in zip(contacts, touching, strict=True)), strict=True):
        hull = ConvexHull(feet.mean(axis=0) + 0.8 * (feet - feet.mean(axis=0))).equations
        inside.append(np.all(hull[:, :2] @ point + hull[:, 2] <= 0.0))
    np.testing.assert_array_equal(unchanged, inside)
    assert 5 < unchanged.sum() < 35


def test_only_touching_contacts_support():
    outside, left = np.array([0.0, 0.3]), np.array([True, True, False, False])
    np.testing.assert_allclose(nearest_supported(outside, FLOOR, ALL, 1.0), [0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(nearest_supported(outside, FLOOR, ~left, 1.0), [0.0, -0.1], atol=1e-12)
    np.testing.assert_array_equal(nearest_supported(outside, FLOOR, ~ALL, 1.0), outside)


def test_shrunk_support_moves_the_nearest_point_inwards():
    np.testing.assert_allclose(nearest_supported(np.array([0.055, 0.3]), FLOOR, ALL, 0.5), [0.055, 0.05])
