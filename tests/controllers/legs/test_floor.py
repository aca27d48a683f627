"""Limb ends of a blend are kept above the floor of its clips and unchanged if they are above it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.legs.floor import keep_above
from tests.controllers.clips_for_maps import LEG, matrices, wxyz
from tests.derivatives import central_differences

SOLE = LEG.points - LEG.points.mean(axis=0)
FLOOR = 0.02


def raised(height, rotation, rate=None, moves=None):
    """How far an end with its lowest point at a height is raised, and the derivatives by its motions."""
    moves = np.zeros((0, 3)) if moves is None else moves
    lowest = (SOLE @ matrices(wxyz(rotation)).T)[:, 2].min()
    end = np.vstack([[0.3, -0.2, height - lowest], moves])
    before = end.copy()
    keep_above(FLOOR, SOLE, end, wxyz(rotation), np.zeros((3, 0)) if rate is None else rate, len(moves))
    np.testing.assert_array_equal(end[:, :2], before[:, :2])
    return end[:, 2] - before[:, 2]


@pytest.mark.parametrize("seed", range(5))
def test_sole_is_at_most_two_millimetres_below_the_floor_and_unmoved_above_it(seed):
    rotation = Rotation.from_rotvec(np.random.default_rng(seed).normal(scale=0.5, size=3))
    for depth in (0.0005, 0.005, 0.05):
        # Below by half of the rounding, above by the share of three points in the soft minimum.
        assert FLOOR - 0.002 < FLOOR - depth + raised(FLOOR - depth, rotation)[0] < FLOOR + 0.0023
    assert raised(FLOOR + 0.0023, rotation)[0] == 0.0


def test_derivative_matches_finite_differences():
    rng = np.random.default_rng(0)
    for _ in range(50):
        rotation, spin, climb = Rotation.from_rotvec(rng.normal(scale=0.5, size=3)), rng.normal(size=3), rng.normal()
        centre = FLOOR - rng.uniform(-0.001, 0.004) - rotation.apply(SOLE)[:, 2].min()

        def height_at(s, rotation=rotation, spin=spin, climb=climb, centre=centre):
            turned = rotation * Rotation.from_rotvec(s * spin)
            end = np.array([[0.0, 0.0, centre + s * climb]])
            keep_above(FLOOR, SOLE, end, wxyz(turned), np.zeros((3, 0)), 0)
            return end[0, 2]

        end = np.array([[0.0, 0.0, centre], [0.0, 0.0, climb]])
        keep_above(FLOOR, SOLE, end, wxyz(rotation), spin[:, None], 1)
        assert end[1, 2] == pytest.approx(central_differences(height_at, 0.0, 1e-6), abs=1e-6)
