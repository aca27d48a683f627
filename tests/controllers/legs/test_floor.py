"""No end of a blend goes below the lowest of its clips; what is above stays as it is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controllers.legs.floor import keep_above
from tests.controllers.clips_for_maps import LEG, matrices, wxyz

SOLE = LEG.points - LEG.points.mean(axis=0)
FLOOR = 0.02


def raised(height, turn, rate=None, moves=None):
    """How far an end is raised whose lowest point is at a height, and by how much more as it moves and turns."""
    moves = np.zeros((0, 3)) if moves is None else moves
    least = (SOLE @ matrices(wxyz(turn)).T)[:, 2].min()
    end = np.vstack([[0.3, -0.2, height - least], moves])
    asked = end.copy()
    keep_above(FLOOR, SOLE, end, wxyz(turn), np.zeros((3, 0)) if rate is None else rate, len(moves))
    np.testing.assert_array_equal(end[:, :2], asked[:, :2])
    return end[:, 2] - asked[:, 2]


@pytest.mark.parametrize("seed", range(5))
def test_no_point_is_left_more_than_two_millimetres_below_and_none_above_is_moved(seed):
    turn = Rotation.from_rotvec(np.random.default_rng(seed).normal(scale=0.5, size=3))
    for depth in (0.0005, 0.005, 0.05):
        # Half of the rounding below, the share of three points in the soft minimum above.
        assert FLOOR - 0.002 < FLOOR - depth + raised(FLOOR - depth, turn)[0] < FLOOR + 0.0023
    assert raised(FLOOR + 0.0023, turn)[0] == 0.0


def test_its_derivative_agrees_with_differences():
    rng, step = np.random.default_rng(0), 1e-6
    for _ in range(50):
        turn, spin, climb = Rotation.from_rotvec(rng.normal(scale=0.5, size=3)), rng.normal(size=3), rng.normal()
        centre = FLOOR - rng.uniform(-0.001, 0.004) - turn.apply(SOLE)[:, 2].min()

        def at(s, turn=turn, spin=spin, climb=climb, centre=centre):
            turned = turn * Rotation.from_rotvec(s * spin)
            end = np.array([[0.0, 0.0, centre + s * climb]])
            keep_above(FLOOR, SOLE, end, wxyz(turned), np.zeros((3, 0)), 0)
            return end[0, 2]

        end = np.array([[0.0, 0.0, centre], [0.0, 0.0, climb]])
        keep_above(FLOOR, SOLE, end, wxyz(turn), spin[:, None], 1)
        assert end[1, 2] == pytest.approx((at(step) - at(-step)) / (2.0 * step), abs=1e-6)
