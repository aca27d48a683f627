import numpy as np
import pytest

from geometry.quaternions import product, rotated, unit
from geometry.two_links import MIN_FLEXION, reach

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("side", [None, -1.0, 1.0])
def test_end_meets_a_line_within_reach_and_points_along_one_beyond_it(side) -> None:
    a, axis = np.tile([0.0, 0.0, -0.42], (200, 1)), unit(np.array([0.1, 1.0, 0.0]) + 0.05 * RNG.normal(size=(200, 3)))
    b = np.array([0.1, 0.02, -0.39]) + 0.05 * RNG.normal(size=(200, 3))
    line = unit(RNG.normal(size=(200, 3))) * np.linspace(0.3, 0.7, 200)[:, None]
    bend, swing = reach(a, b, axis, line, side)
    np.testing.assert_allclose(rotated(swing, a) + rotated(product(swing, bend), b), line, atol=1e-12)
    np.testing.assert_allclose(rotated(bend, axis), axis, atol=1e-12)
    bend, swing = reach(a, b, axis, 2.0 * line / np.linalg.norm(line, axis=1)[:, None], side)
    end = rotated(swing, a) + rotated(product(swing, bend), b)
    np.testing.assert_allclose(unit(end), unit(line), atol=1e-12)
    straight = np.linalg.norm(a, axis=1) + np.linalg.norm(b, axis=1)
    assert (np.linalg.norm(end, axis=1) <= straight * (1.0 - 0.1 * MIN_FLEXION**2)).all()
