"""Cores of lifted curves: within one the hand is drawn to the curve, smoothly, and no two of them overlap."""

import numpy as np
import pytest
from test_lifted_weights import wandering

from controllers.curves.splines import basis, round_lap
from controllers.haptic_map.lifting.cores import _MAX_CORE_RADIUS, core_points, draw_in
from tests.controllers.clips_for_maps import stylus
from tests.controllers.haptic_map.test_lifted_map import MAP

TURN = 2.0 * np.pi


def cores_at(points, angle):
    """b of all sites at an angle, by their control points, of which the first three stand again at the end."""
    s = angle * (len(points) - 3) / TURN
    return np.array(basis(s - int(s))) @ points[int(s) : int(s) + 4]


@pytest.mark.parametrize("m", [2, 4, 9, 40])
def test_cores_do_not_overlap_and_are_as_wide_as_there_is_room(m):
    sites, shares = wandering(m), []
    points = core_points(sites)
    for angle in np.linspace(0.0, TURN, 500, endpoint=False):
        places, cores = round_lap(sites, angle), cores_at(points, angle)
        distance = np.linalg.norm(places[:, None] - places, axis=2) + np.diag(np.full(m, np.inf))
        assert (cores[:, None] + cores < distance).all()
        assert (cores <= _MAX_CORE_RADIUS + 1e-12).all()
        shares.append(cores / np.minimum(0.45 * distance.min(axis=1), _MAX_CORE_RADIUS))
    assert np.mean(shares) > 0.7


def drawn(angle, place):
    """Where a place is drawn to by a site that wanders, and its derivatives by θ, r, z; None outside of the core."""
    site = np.array([[0.05 + 0.004 * np.sin(angle), 0.003 * np.cos(angle), 0.02, 0.006 + 0.001 * np.sin(2.0 * angle)]])
    slope = np.array([[0.004 * np.cos(angle), -0.003 * np.sin(angle), 0.0, 0.002 * np.cos(2.0 * angle)]])
    result, change = np.empty(2), np.empty((3, 2))
    if not draw_in(*place, site, slope, result, change):
        return None
    return result, change, site[0]


def test_its_derivatives_agree_with_differences():
    rng, step, seen = np.random.default_rng(4), 1e-6, 0
    for angle, r, z in rng.uniform([0.0, 0.046, -0.004], [TURN, 0.054, 0.004], (300, 3)):
        found = drawn(angle, (r, z))
        at = np.array([angle, r, z])
        ways = [[drawn(x[0], x[1:]) for x in (at - d, at + d)] for d in step * np.diag([1.0, 0.01, 0.01])]
        if found is None or any(end is None for way in ways for end in way):
            continue
        seen += 1
        for k, (low, high) in enumerate(ways):
            slope = (high[0] - low[0]) / (2.0 * step * (1.0 if k == 0 else 0.01))
            np.testing.assert_allclose(slope, found[1][k], atol=1e-6)
    assert seen > 100


def test_near_the_site_a_place_is_drawn_to_it_and_at_the_edge_it_stays():
    place, _, site = drawn(1.0, (drawn(1.0, (0.053, 0.002))[2][0], drawn(1.0, (0.053, 0.002))[2][1]))
    np.testing.assert_array_equal(place, site[:2])
    for share, least, most in ((0.25, 0.0, 0.03), (0.5, 0.2, 0.3), (0.999, 0.998, 0.999)):
        away = share * site[3] * np.array([0.6, 0.8])
        moved, _, _ = drawn(1.0, site[:2] + away)
        assert least <= np.linalg.norm(moved - site[:2]) / site[3] <= most
    assert drawn(1.0, site[:2] + 1.001 * site[3] * np.array([0.6, 0.8])) is None


def test_a_hand_a_millimetre_off_its_curve_plays_the_clip():
    for angle in np.linspace(0.1, 6.1, 12):
        for i in range(4):
            r, z = MAP.site(i, np.array(angle))
            for way in np.linspace(0.0, TURN, 5):
                w = MAP.weights(stylus(r + 1e-3 * np.cos(way), angle, z + 1e-3 * np.sin(way)))
                assert abs(w[i] - 1.0) < 0.01
            # And h_* says so: on the curve nothing changes sideways.
            jacobian = MAP.jacobian(stylus(r, angle, z))
            across = np.array([np.cos(angle), np.sin(angle), 0.0])
            assert np.abs(jacobian[:, :3] @ across).max() < 1e-4 * np.abs(jacobian).max()
            assert np.abs(jacobian[:, 2]).max() < 1e-4 * np.abs(jacobian).max()
