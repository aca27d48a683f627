"""Weights of the lifted map: exact at the sites, signed beside them, bounded, smooth, zero for distant clips."""

import numpy as np
import pytest

from controllers.curves.splines import periodic_interpolation
from controllers.haptic_map.lifting.neighbours import (
    _MAX_PLANE_TERM,
    SITE,
    near_clips,
    near_weights,
    packed_neighbours,
    reaches,
)
from tests.derivatives import extrapolated_differences

TURN = 2.0 * np.pi
R, Z = (0.028, 0.072), (-0.022, 0.022)


def moving_sites(m, rows=48):
    """Sites of m curves that move about lattice points by a third of the lattice step, shape (rows, m, 2)."""
    side = int(np.ceil(np.sqrt(m)))
    step = 0.04 / max(side - 1, 1)
    lap, k = np.arange(rows)[:, None] * TURN / rows, np.arange(m)
    r = 0.03 + step * (k % side) + 0.3 * step * np.sin(lap + k)
    z = -0.02 + step * (k // side) + 0.3 * step * np.cos(2.0 * lap + 3.0 * k)
    return np.stack([np.clip(r, 0.029, 0.071), np.clip(z, -0.021, 0.021)], axis=-1)


class Weights:
    """Weights of all clips at a position and their derivatives, shape (4, m), and the near clips."""

    def __init__(self, sites):
        self.m, self.numbers = sites.shape[1], packed_neighbours(sites, R, Z)

    def near(self, angle, r, z):
        clips, sites, slopes = np.empty(self.m, dtype=np.int64), np.empty((self.m, SITE)), np.empty((self.m, SITE))
        count = near_clips(self.numbers, angle, r, z, clips, sites, slopes)
        return clips[:count], sites[:count], slopes[:count]

    def __call__(self, angle, r, z):
        clips, sites, slopes = self.near(angle, r, z)
        w, changes = np.empty(len(clips)), np.empty((3, len(clips)))
        near_weights(self.numbers, r, z, sites, slopes, w, changes)
        result = np.zeros((4, self.m))
        result[0, clips], result[1:, clips] = w, changes
        return result


def random_positions(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform([0.0, R[0], Z[0]], [TURN, R[1], Z[1]], (n, 3))


@pytest.mark.parametrize("m", [1, 2, 3, 4, 9, 40])
def test_weights_are_one_at_own_site_and_sum_to_one(m):
    sites, weights = moving_sites(m), Weights(moving_sites(m))
    for row in range(0, len(sites), 7):
        for i in range(m):
            w = weights(row * TURN / len(sites), *sites[row, i])
            np.testing.assert_allclose(w[0], np.eye(m)[i], atol=1e-12)
    for position in random_positions(200):
        w = weights(*position)
        assert w[0].sum() == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(w[1:].sum(axis=1), 0.0, atol=1e-9)


@pytest.mark.parametrize("m", [4, 9, 40])
def test_derivatives_match_finite_differences(m):
    weights = Weights(moving_sites(m))
    for position in random_positions(60, seed=m):
        w = weights(*position)
        scale = 1.0 + np.abs(w[1:]).max()
        for axis, step, derivative in zip(np.eye(3), (1e-4, 1e-6, 1e-6), w[1:], strict=True):
            along = extrapolated_differences(
                lambda h, position=position, axis=axis: weights(*(position + h * axis))[0], 0.0, step
            )
            np.testing.assert_allclose(along, derivative, atol=1e-6 * scale)


def test_gradient_at_a_curve_fits_the_plane_through_its_neighbours():
    sites = np.tile(np.array([[x, y] for y in (-0.02, 0.0, 0.02) for x in (0.03, 0.05, 0.07)]), (16, 1, 1))
    weights = Weights(sites)
    gradient = weights(1.0, *sites[0, 4])[2:]
    # Non-negative weights would have a zero gradient here.
    plane = gradient @ (sites[0] - sites[0, 4])
    np.testing.assert_allclose(plane, np.eye(2), atol=0.1)
    beside = weights(1.0, 0.0505, 0.0)[0]
    assert beside[5] > 0.01
    assert beside[3] < -0.005


def test_weights_are_bounded_and_hardly_negative_between_curves():
    for m in (2, 3, 4, 9, 36):
        weights = Weights(moving_sites(m))
        w = np.array([weights(*position)[0] for position in random_positions(2000, seed=m)])
        assert w.min() > -_MAX_PLANE_TERM
        assert w.max() < 1.0 + _MAX_PLANE_TERM
        # Only for these numbers does the lattice fill the domain.
        if m in (4, 9, 36):
            assert np.median(w.min(axis=1)) > -0.06
    # Extrapolation is greatest beyond two curves that nearly cross.
    pair = Weights(np.tile(np.array([[0.03, 0.0], [0.032, 0.0]]), (16, 1, 1)))
    w = np.array([pair(*position)[0] for position in random_positions(500)])
    assert -_MAX_PLANE_TERM < w.min() < -0.01


@pytest.mark.slow
def test_near_clips_are_those_whose_reach_contains_the_position():
    sites = moving_sites(40)
    weights, reach = Weights(sites), reaches(sites, R, Z)
    for angle, r, z in random_positions(1000):
        (places_at, reach_at) = periodic_interpolation(sites, angle), periodic_interpolation(reach, angle)
        distance = np.hypot(r - places_at[:, 0], z - places_at[:, 1])
        assert set(np.flatnonzero(distance < reach_at)) == set(weights.near(angle, r, z)[0])


def test_number_of_near_clips_does_not_grow_with_the_number_of_clips():
    few, many = (np.mean([len(weights.near(*position)[0]) for position in random_positions(200)]) for weights in (
        Weights(moving_sites(10)), Weights(moving_sites(100))
    ))  # fmt: skip
    assert many < 1.8 * few


def test_every_position_has_a_clip_also_where_curves_crowd():
    rng = np.random.default_rng(2)
    # All but one are in one corner.
    crowd = np.tile(rng.uniform([0.03, -0.02], [0.036, -0.015], (9, 2)), (16, 1, 1))
    lone = np.tile([[[0.07, 0.02]]], (16, 1, 1))
    weights = Weights(np.concatenate([crowd, lone], axis=1))
    for position in random_positions(1000):
        assert weights(*position)[0].sum() == pytest.approx(1.0, abs=1e-12)
