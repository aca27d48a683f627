"""Derivatives of all maps against differences on the manifold, and their continuity along lines."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_composite_map import MAP as COMPOSITE
from test_cylindrical_map import MOVING as CYLINDRICAL
from test_lifted_map import ARMS, FREE
from test_lifted_map import MAP as LIFTED

from controllers.haptic_map.lifting.sites import box
from tests.controllers.clips_for_maps import stylus

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
OWNED = FREE.with_legs_of(1, ARMS, 0.6)
MAPS = {"cylindrical": CYLINDRICAL, "composite": COMPOSITE, "lifted": LIFTED, "lifted, legs of one clip": OWNED}


def differences(end, start):
    """Tangents from poses (n, nq) to poses: root position, then local rotation vectors, shape (n, nv)."""
    n = len(end)
    a, b = (Rotation.from_quat(p[:, 3:].reshape(-1, 4), scalar_first=True) for p in (start, end))
    return np.concatenate([end[:, :3] - start[:, :3], (a.inv() * b).as_rotvec().reshape(n, -1)], axis=1)


@pytest.mark.parametrize("name", MAPS)
def test_the_derivative_agrees_with_differences_at_a_thousand_places(name):
    h_map, rng, step = MAPS[name], np.random.default_rng(7), 1e-6
    x = np.array([
        stylus(*place) for place in rng.uniform([0.025, 0.001, -0.035], [0.075, 6.282, 0.035], (1000, 3))
    ])  # fmt: skip
    jacobians = np.array([h_map.jacobian(at) for at in x])
    error = np.zeros(len(x))
    for axis in range(3):
        d = step * np.eye(7)[axis]
        poses = {k: np.array([h_map.pose(at + k * d) for at in x]) for k in (-2, -1, 1, 2)}
        near, far = (differences(poses[k], poses[-k]) / (2 * k * step) for k in (1, 2))
        error = np.maximum(error, np.abs((4.0 * near - far) / 3.0 - jacobians[:, :, axis]).max(axis=1))
    assert (error / (1e-2 + np.abs(jacobians).max(axis=(1, 2)))).max() < 1e-6
    np.testing.assert_array_equal(jacobians[:, :, 3:], 0.0)


def lines():
    """Straight lines through the domain and over its edges, none through the axis."""
    rng = np.random.default_rng(11)
    for _ in range(4):
        angle = rng.uniform(0.3, 5.9)
        middle = stylus(rng.uniform(0.045, 0.055), angle, rng.uniform(-0.01, 0.01))[:3]
        way = rng.normal(size=3)
        yield middle, way / np.linalg.norm(way)


def along(h_map, middle, way, steps, step):
    """Poses and directional derivatives at equal steps of a line."""
    x = [np.concatenate([middle + (k - steps / 2) * step * way, UPRIGHT]) for k in range(steps + 1)]
    return np.array([h_map.pose(at) for at in x]), np.array([h_map.jacobian(at)[:, :3] @ way for at in x])


@pytest.mark.parametrize("name", MAPS)
def test_it_does_not_jump_along_a_line(name):
    for middle, way in lines():
        poses, rates = along(MAPS[name], middle, way, 2000, 2e-6)
        jump = differences(poses[1:], poses[:-1]) - 1e-6 * (rates[1:] + rates[:-1])
        assert np.abs(jump).max() < 1e-9


@pytest.mark.parametrize("name", MAPS)
def test_its_derivative_has_no_kink_along_a_line(name):
    for middle, way in lines():
        # A kink of the derivative makes its second differences as large as the step, else they go with its square.
        coarse, fine = (
            np.abs(np.diff(along(MAPS[name], middle, way, round(0.04 / step), step)[1], 2, axis=0)).max()
            for step in (4e-5, 1e-5)
        )
        assert fine < 0.125 * coarse


def test_it_has_no_kink_where_a_line_passes_a_curve_and_the_edge_of_the_domain():
    (r_low, _), (_, z_high) = box(LIFTED.sites)
    curve = LIFTED.curve(1)
    for middle in (curve.point(1.3), stylus(r_low, 2.0, 0.0)[:3], stylus(0.05, 3.0, z_high)[:3]):
        for way in (np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.6, -0.8])):
            second = [
                np.abs(np.diff(along(LIFTED, middle, way, round(0.004 / step), step)[1], 2, axis=0)).max()
                for step in (2e-5, 5e-6)
            ]
            assert second[1] < 0.125 * second[0]
