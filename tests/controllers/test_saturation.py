"""Saturation of scalars and vectors: identity inside, constant far outside, C² between, exact derivatives."""

import numpy as np
import pytest

from controllers.saturation import saturate_vector, soft_clamp
from tests.derivatives import central_differences

LOW, HIGH, MARGIN = -0.02, 0.03, 0.004


def test_clamped_is_the_identity_inside_and_constant_beyond_the_margin():
    for x in np.linspace(LOW, HIGH, 11):
        assert soft_clamp(x, LOW, HIGH, MARGIN) == (x, 1.0)
    for beyond in (MARGIN, 2.0 * MARGIN, 1e6):
        assert soft_clamp(HIGH + beyond, LOW, HIGH, MARGIN) == pytest.approx((HIGH + 0.5 * MARGIN, 0.0), abs=1e-15)
        assert soft_clamp(LOW - beyond, LOW, HIGH, MARGIN) == pytest.approx((LOW - 0.5 * MARGIN, 0.0), abs=1e-15)


def test_clamped_value_and_two_derivatives_are_continuous():
    x = np.linspace(LOW - 2.0 * MARGIN, HIGH + 2.0 * MARGIN, 40001)
    value, slope = np.array([soft_clamp(at, LOW, HIGH, MARGIN) for at in x]).T
    step = x[1] - x[0]
    np.testing.assert_allclose(np.diff(value) / step, 0.5 * (slope[1:] + slope[:-1]), atol=1e-5)
    # The second derivative is at most 1.5/m and its slope 6/m², which bounds the difference of neighbours.
    assert np.abs(np.diff(slope, 2)).max() / step < 1.1 * 6.0 / MARGIN**2 * step


@pytest.mark.parametrize("length", [0.0, 0.01, 0.024, 0.0255, 0.4])
def test_saturated_vector_keeps_its_direction_in_the_ball_with_exact_jacobian(length):
    rng, inner, outer = np.random.default_rng(5), 0.02, 0.025
    for _ in range(20):
        v = rng.normal(size=3)
        v *= length / np.linalg.norm(v)
        slope, moved = np.empty((3, 3)), v.copy()
        saturate_vector(moved, inner, outer, slope)
        assert np.linalg.norm(moved) <= outer + 1e-15
        np.testing.assert_allclose(np.cross(moved, v), 0.0, atol=1e-15)

        def saturated(x):
            result = x.copy()
            saturate_vector(result, inner, outer, np.empty((3, 3)))
            return result

        np.testing.assert_allclose(central_differences(saturated, v, 1e-6), slope, atol=1e-6)
