"""Cores of lifted curves: disjoint tubes in which the effective hand position is drawn smoothly to the curve."""

import numpy as np
import pytest
from test_lifted_weights import moving_sites

from controllers.curves.splines import basis, periodic_interpolation
from controllers.haptic_map.lifting.cores import _MAX_CORE_RADIUS, attract_to_core, core_points
from tests.controllers.clips_for_maps import stylus
from tests.controllers.example_maps import LIFTED
from tests.derivatives import central_differences

TURN = 2.0 * np.pi


def cores_at(points, angle):
    """Core radius of all sites at an angle, from control points of which the first three are repeated at the end."""
    s = angle * (len(points) - 3) / TURN
    return np.array(basis(s - int(s))) @ points[int(s) : int(s) + 4]


@pytest.mark.parametrize("m", [2, 4, 9, 40])
def test_cores_do_not_overlap_and_use_the_available_room(m):
    sites, shares = moving_sites(m), []
    points = core_points(sites)
    for angle in np.linspace(0.0, TURN, 500, endpoint=False):
        centres, cores = periodic_interpolation(sites, angle), cores_at(points, angle)
        distance = np.linalg.norm(centres[:, None] - centres, axis=2) + np.diag(np.full(m, np.inf))
        assert (cores[:, None] + cores < distance).all()
        assert (cores <= _MAX_CORE_RADIUS + 1e-12).all()
        shares.append(cores / np.minimum(0.45 * distance.min(axis=1), _MAX_CORE_RADIUS))
    assert np.mean(shares) > 0.7


def drawn(angle, position):
    """Drawn-in (r, z), its derivatives by θ, r, z and the (moving) site of a position; None outside the core."""
    site = np.array([[0.05 + 0.004 * np.sin(angle), 0.003 * np.cos(angle), 0.02, 0.006 + 0.001 * np.sin(2.0 * angle)]])
    slope = np.array([[0.004 * np.cos(angle), -0.003 * np.sin(angle), 0.0, 0.002 * np.cos(2.0 * angle)]])
    result, change = np.empty(2), np.empty((3, 2))
    if not attract_to_core(*position, site, slope, result, change):
        return None
    return result, change, site[0]


def test_derivatives_of_draw_in_match_finite_differences():
    rng, steps, compared = np.random.default_rng(4), 1e-6 * np.array([1.0, 0.01, 0.01]), 0
    for x in rng.uniform([0.0, 0.046, -0.004], [TURN, 0.054, 0.004], (300, 3)):
        found = drawn(x[0], x[1:])
        if found is None or any(drawn(y[0], y[1:]) is None for d in np.diag(steps) for y in (x - d, x + d)):
            continue
        compared += 1
        for axis, step, derivative in zip(np.eye(3), steps, found[1], strict=True):

            def along(h, x=x, axis=axis):
                y = x + h * axis
                return drawn(y[0], y[1:])[0]

            np.testing.assert_allclose(central_differences(along, 0.0, step), derivative, atol=1e-6)
    assert compared > 100


def test_draw_in_moves_near_positions_to_the_site_and_keeps_the_edge():
    position, _, site = drawn(1.0, (drawn(1.0, (0.053, 0.002))[2][0], drawn(1.0, (0.053, 0.002))[2][1]))
    np.testing.assert_array_equal(position, site[:2])
    for share, least, greatest in ((0.25, 0.0, 0.03), (0.5, 0.2, 0.3), (0.999, 0.998, 0.999)):
        away = share * site[3] * np.array([0.6, 0.8])
        moved, _, _ = drawn(1.0, site[:2] + away)
        assert least <= np.linalg.norm(moved - site[:2]) / site[3] <= greatest
    assert drawn(1.0, site[:2] + 1.001 * site[3] * np.array([0.6, 0.8])) is None


def test_hand_one_millimetre_off_its_curve_plays_the_clip():
    for angle in np.linspace(0.1, 6.1, 12):
        for i in range(4):
            r, z = LIFTED.site(i, np.array(angle))
            for direction in np.linspace(0.0, TURN, 5):
                w = LIFTED.weights(stylus(r + 1e-3 * np.cos(direction), angle, z + 1e-3 * np.sin(direction)))
                assert abs(w[i] - 1.0) < 0.01
            # On the curve the Jacobian has no component across it.
            jacobian = LIFTED.jacobian(stylus(r, angle, z))
            across = np.array([np.cos(angle), np.sin(angle), 0.0])
            assert np.abs(jacobian[:, :3] @ across).max() < 1e-4 * np.abs(jacobian).max()
            assert np.abs(jacobian[:, 2]).max() < 1e-4 * np.abs(jacobian).max()
