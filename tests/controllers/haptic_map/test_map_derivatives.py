"""Maps of clips: compiled as in Python; Jacobians against finite differences on the manifold, and along lines."""

import numpy as np
import pytest

from controllers.haptic_map.lifting.sites import box
from tests.controllers.clips_for_maps import assert_same_compiled, difference, stylus
from tests.controllers.example_maps import (
    ARM_JOINTS,
    COMPOSITE_WITH_LEGS,
    CYLINDRICAL,
    CYLINDRICAL_ARMS,
    LIFTED,
    WITHOUT_LIMBS,
)
from tests.derivatives import extrapolated_differences

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
LEGS_OF_ONE = WITHOUT_LIMBS.with_legs_of(1, ARM_JOINTS, 0.6)
MAPS = {
    "cylindrical": CYLINDRICAL, "cylindrical, legs of one clip": CYLINDRICAL_ARMS, "composite": COMPOSITE_WITH_LEGS,
    "lifted": LIFTED, "lifted, legs of one clip": LEGS_OF_ONE,
}  # fmt: skip


@pytest.mark.parametrize("name", MAPS)
def test_compiled_map_is_identical(name):
    assert_same_compiled(MAPS[name], stylus(0.05, 2.0, 0.004))


@pytest.mark.parametrize("name", MAPS)
def test_jacobian_matches_finite_differences_at_a_thousand_positions(name):
    h_map, rng = MAPS[name], np.random.default_rng(7)
    x = np.array([
        stylus(*cylindrical) for cylindrical in rng.uniform([0.025, 0.001, -0.035], [0.075, 6.282, 0.035], (1000, 3))
    ])  # fmt: skip
    jacobians = np.array([h_map.jacobian(at) for at in x])
    error = np.zeros(len(x))
    for axis, unit in enumerate(np.eye(7)[:3]):
        poses_at = lambda h, unit=unit: np.array([h_map.pose(at + h * unit) for at in x])  # noqa: E731
        numeric = extrapolated_differences(poses_at, 0.0, 1e-6, difference)
        error = np.maximum(error, np.abs(numeric - jacobians[:, :, axis]).max(axis=1))
    assert (error / (1e-2 + np.abs(jacobians).max(axis=(1, 2)))).max() < 1e-6
    np.testing.assert_array_equal(jacobians[:, :, 3:], 0.0)


def lines():
    """Straight lines through the domain and over its edges, none through the axis."""
    rng = np.random.default_rng(11)
    for _ in range(4):
        angle = rng.uniform(0.3, 5.9)
        middle = stylus(rng.uniform(0.045, 0.055), angle, rng.uniform(-0.01, 0.01))[:3]
        direction = rng.normal(size=3)
        yield middle, direction / np.linalg.norm(direction)


def along(h_map, middle, direction, steps, step):
    """Poses and directional derivatives at equal steps of a line."""
    x = [np.concatenate([middle + (k - steps / 2) * step * direction, UPRIGHT]) for k in range(steps + 1)]
    return np.array([h_map.pose(at) for at in x]), np.array([h_map.jacobian(at)[:, :3] @ direction for at in x])


@pytest.mark.parametrize("name", MAPS)
def test_pose_is_continuous_along_lines(name):
    for middle, direction in lines():
        poses, rates = along(MAPS[name], middle, direction, 2000, 2e-6)
        jump = difference(poses[1:], poses[:-1]) - 1e-6 * (rates[1:] + rates[:-1])
        assert np.abs(jump).max() < 1e-9


@pytest.mark.parametrize("name", MAPS)
def test_jacobian_has_no_kink_along_lines(name):
    for middle, direction in lines():
        # Second differences go with the step at a kink of the Jacobian, otherwise with its square.
        coarse, fine = (
            np.abs(np.diff(along(MAPS[name], middle, direction, round(0.04 / step), step)[1], 2, axis=0)).max()
            for step in (4e-5, 1e-5)
        )
        assert fine < 0.125 * coarse


def test_jacobian_has_no_kink_at_a_curve_or_the_edge_of_the_domain():
    (r_low, _), (_, z_high) = box(LIFTED.sites)
    curve = LIFTED.curve(1)
    for middle in (curve.point(1.3), stylus(r_low, 2.0, 0.0)[:3], stylus(0.05, 3.0, z_high)[:3]):
        for direction in (np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.6, -0.8])):
            second = [
                np.abs(np.diff(along(LIFTED, middle, direction, round(0.004 / step), step)[1], 2, axis=0)).max()
                for step in (2e-5, 5e-6)
            ]
            assert second[1] < 0.125 * second[0]
