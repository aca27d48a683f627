"""The bunny in the limit of infinite width, and scalar kernels of fields against CasADi."""

import casadi
import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.higher_order import mismatch
from controllers.state import HandState
from geometry.easing import smooth_step

CIRCLE = Trajectory.circle(0.05, 4.0)
RNG = np.random.default_rng(0)
HANDS = [HandState.at(RNG.normal(size=3) * 0.04, RNG.normal(size=3) * 0.1, RNG.uniform(0.0, 9.0)) for _ in range(40)]


def test_pull_along_the_curve_tends_to_follow_with_the_square_of_the_width():
    follow = Follow(CIRCLE, 200.0, 4.0, np.inf)
    for hand in HANDS:
        static = follow.wrench(hand).force
        square = np.sum((hand.p - CIRCLE.point(hand.t)) ** 2)
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


@pytest.mark.parametrize(("kernel", "arity"), [(mismatch, 4), (smooth_step, 1)])
def test_compiled_scalar_kernel_matches_casadi(kernel, arity):
    casadi.GlobalOptions.setNumpyMode(1)
    symbols = [casadi.SX.sym(f"x{i}") for i in range(arity)]
    function = casadi.Function("law", symbols, [kernel.py_func(*symbols)])
    for _ in range(30):
        numbers = RNG.uniform(0.1, 1.0, arity)
        assert float(function(*numbers)) == pytest.approx(kernel(*numbers), rel=1e-13)
