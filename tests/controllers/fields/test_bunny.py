"""The bunny in the limit of infinite width, and convolved with a Gaussian, as in the paper, against quadrature."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.state import HandState

CIRCLE = Trajectory.circle(0.05, 4.0)
RNG = np.random.default_rng(0)
HANDS = [HandState.at(RNG.normal(size=3) * 0.04, RNG.normal(size=3) * 0.1, RNG.uniform(0.0, 9.0)) for _ in range(40)]


def test_pull_along_the_curve_tends_to_follow_with_the_square_of_the_width():
    follow = Follow(CIRCLE, 200.0, 4.0, np.inf)
    for hand in HANDS:
        static = follow.wrench(hand).force
        square = np.sum((hand.p - CIRCLE.point(hand.t)) ** 2)
        widest = Bunny(CIRCLE, 200.0, 4.0, np.inf, "along", "clock").wrench(hand).force
        np.testing.assert_array_equal(widest, static)
        for delta in (0.1, 1.0, 10.0):
            gap = np.linalg.norm(Bunny(CIRCLE, 200.0, 4.0, delta, "along", "clock").wrench(hand).force - static)
            bound = np.linalg.norm(static) * square / (2.0 * delta**2)
            assert gap <= bound * (1.0 + 1e-9) + 1e-12
            assert gap >= bound * (1.0 - square / (2.0 * delta**2)) - 1e-12


def test_pull_to_the_point_with_infinite_width_is_a_spring_and_damper():
    for hand in HANDS:
        spring = 200.0 * (CIRCLE.point(hand.t) - hand.p) + 4.0 * (CIRCLE.velocity(hand.t) - hand.v)
        np.testing.assert_allclose(
            Bunny(CIRCLE, 200.0, 4.0, np.inf, "point", "clock").wrench(hand).force, spring, atol=1e-12
        )


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.012, -0.007, 0.004), (-0.03, 0.02, 0.01)])
def test_convolved_bunny_matches_gauss_hermite_quadrature(offset):
    k, b, delta = 300.0, 8.0, 0.02
    bunny, pace = CIRCLE.point(0.7), CIRCLE.velocity(0.7)
    p, v = bunny + np.array(offset), np.array([0.02, -0.01, 0.03])
    # Gauss and Hermite: ∫ f(q) G_δ(p − q) d³q / (2πδ²)^{3/2}, with f felt within δ of the bunny.
    nodes, weights = np.polynomial.hermite.hermgauss(40)
    x = np.sqrt(2.0) * delta * nodes
    q = p + np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1)
    mass = np.einsum("i,j,k->ijk", weights, weights, weights) / np.pi**1.5
    felt = np.exp(-0.5 * np.sum((q - bunny) ** 2, axis=-1) / delta**2)
    field = felt[..., None] * (k * (bunny - q) + b * (pace - v))
    integral = np.einsum("ijk,ijkc->c", mass, field)
    law = Bunny(CIRCLE, k, b, delta, "convolution", "clock")
    np.testing.assert_allclose(law.wrench(HandState.at(p, v, 0.7)).force, integral, atol=1e-9)


def test_point_attraction_exceeds_convolution_and_unknown_form_is_refused():
    p, v = CIRCLE.point(0.7) + 0.01, np.zeros(3)
    weighted, convolved = (
        Bunny(CIRCLE, 300.0, 8.0, 0.02, form, "clock").wrench(HandState.at(p, v, 0.7)).force
        for form in ("point", "convolution")
    )
    assert np.linalg.norm(weighted) > 2.0 * np.linalg.norm(convolved)
    with pytest.raises(ParameterError, match="convolution"):
        Bunny(CIRCLE, 300.0, 8.0, 0.02, "smeared")  # pyright: ignore[reportArgumentType]
