"""The field algebra: each operation against its formula."""

from fractions import Fraction

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.weights import Weight, window
from controllers.fields.bundle import RiverBundle
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.own.own_law import PythonLaw
from controllers.fields.river import River
from controllers.state import HandState
from tests.controllers.fields.field_probes import force_of, largest_jump

A = Follow(Trajectory.circle(0.05, 4.0), 200.0, 4.0, 0.03).program()
B = Follow(Trajectory.circle(0.03, 2.0), 100.0, 1.0, 0.028).program()
HAND = HandState.at([0.04, 0.01, 0.005], [0.1, -0.05, 0.02], 0.3)
F, G = force_of(A, HAND), force_of(B, HAND)
SPEED = np.linalg.norm(HAND.v)


def _step(x):
    return 6 * x**5 - 15 * x**4 + 10 * x**3


@pytest.mark.parametrize(
    ("weight", "s"),
    [
        (Weight.constant(-2.5), -2.5),
        (Weight.ball([0.04, 0.0, 0.0], 0.02), window((0.01**2 + 0.005**2) / 0.02**2)),
        (Weight.ball([0.0, 0.0, 0.1], 0.02), 0.0),
        (Weight.speed(0.1, 0.2), _step((SPEED - 0.1) / 0.1)),
        (Weight.speed(0.2, 0.3), 0.0),
        (Weight.speed(0.0, 0.05), 1.0),
        (Weight.switch(), 0.0),
    ],
)
def test_gate_and_blend_match_their_formulas(weight, s):
    np.testing.assert_allclose(force_of(A.gated(weight), HAND), s * F, rtol=1e-12)
    np.testing.assert_allclose(force_of(A.gated(~weight), HAND), (1 - s) * F, rtol=1e-12)
    np.testing.assert_allclose(force_of(A.blended(B, weight), HAND), (1 - s) * F + s * G, rtol=1e-12)


def test_field_lists_the_curves_of_its_laws_without_duplicates():
    circle, other = Trajectory.circle(0.05, 4.0), Trajectory.circle(0.03, 2.0)
    first, second = River(circle, 0.03, 0.02, 4.0), River(other, 0.02, 0.02, 4.0)
    bundle = RiverBundle((first, second), ("a", "b"))
    zero_law = PythonLaw(lambda hand: np.zeros(3))
    assert zero_law.curves == ()
    assert (Follow(other, 100.0, 1.0, 0.028) + zero_law + Follow(circle, 200.0, 4.0, 0.03)).curves == (other, circle)
    crossing = HigherOrder(bundle, admission=0.02, sigma=0.01)
    assert crossing.curves == crossing.limited(3.0).curves == (circle, other)


def test_switch_gates_and_blends():
    pressed = HandState(HAND.t, HAND.p, HAND.q, HAND.v, HAND.w, switch=True)
    np.testing.assert_array_equal(force_of(A.gated(Weight.switch()), pressed), F)
    np.testing.assert_array_equal(force_of(A.blended(B, Weight.switch()), pressed), G)


def test_limiter_keeps_direction_of_strong_and_length_of_weak_forces():
    size = np.linalg.norm(F)
    np.testing.assert_allclose(force_of(A.limited(0.3 * size), HAND), 0.3 * F, rtol=1e-12)
    np.testing.assert_array_equal(force_of(A.limited(2.0 * size), HAND), F)
    far = Follow(Trajectory.circle(0.05, 4.0), 200.0, 4.0, np.inf).program().limited(8.0)
    assert np.linalg.norm(force_of(far, HandState.at([1e100, 0.0, 0.0]))) == pytest.approx(8.0)


def test_nested_composition_is_evaluated_as_written():
    inner = (A + 2.0 * B).limited(1.0)
    field = inner.blended(B.gated(Weight.speed(0.1, 0.2)), Weight.constant(0.25)) + A
    total = F + 2.0 * G
    total *= min(1.0, 1.0 / np.linalg.norm(total))
    expected = 0.75 * total + 0.25 * _step((SPEED - 0.1) / 0.1) * G + F
    np.testing.assert_allclose(force_of(field, HAND), expected, rtol=1e-12)


def test_sums_differences_and_quotients_match_their_formulas():
    np.testing.assert_array_equal(force_of(A - B, HAND), F - G)
    np.testing.assert_array_equal(force_of(-A, HAND), -F)
    np.testing.assert_array_equal(force_of(A / 4, HAND), 0.25 * F)
    np.testing.assert_array_equal(force_of(sum([A, B, A]), HAND), F + G + F)
    assert sum([A]) is A
    assert (A / 4).description() == (0.25 * A).description() == (A * 0.25).description()
    compiled = CompiledLaw(lambda hand: (hand.p[0], 0.0, 0.0))
    np.testing.assert_allclose((-compiled - A / 2).wrench(HAND).force, [-0.04, 0.0, 0.0] - 0.5 * F, rtol=1e-12)


def test_deep_sum_nested_to_the_right_is_evaluated():
    field, expected = A, F
    for _ in range(40):
        field, expected = B + field, G + expected
    np.testing.assert_array_equal(force_of(field, HAND), expected)


def test_description_of_a_sum_is_no_deeper_for_more_laws():
    described = sum([A] * 350).limited(5.0).description()  # nested, 300 exceed Python's depth of recursion
    assert described == {"limit": [{"add": [A.description()] * 350, "parameters": []}], "parameters": [5.0, np.inf]}


def test_fractions_are_accepted_as_numbers():
    assert Weight.constant(Fraction(1, 4)) == Weight.constant(0.25)
    np.testing.assert_array_equal((Fraction(1, 2) * A).limited(Fraction(1, 4)).params[-2:], [0.25, np.inf])


def test_composed_field_is_continuous():
    rng = np.random.default_rng(0)
    field = (A.gated(~Weight.ball([0.05, 0.0, 0.0], 0.02)) + B).limited(1.5)
    for _ in range(6):
        start = rng.uniform(-0.02, 0.02, 3) + np.array([0.01, -0.01, 0.0])
        assert largest_jump(field, start, start + np.array([0.08, 0.03, 0.01]), [0.05, 0.1, 0.0]) < 1e-9


def test_python_laws_keep_their_order_through_the_algebra():
    one, two = (PythonLaw(lambda hand, k=k: [k, 0.0, 0.0]) for k in (1.0, 2.0))
    field = (one.program() + A).blended(two.program().limited(5.0), Weight.constant(0.5))
    assert [law(HAND)[0] for law in field.python_laws] == [1.0, 2.0]
    assert len(field.python_feeds) == 2
    np.testing.assert_allclose(field.wrench(HAND).force, 0.5 * F + np.array([1.5, 0.0, 0.0]), rtol=1e-12)
    np.testing.assert_array_equal(one.wrench(HAND).force, [1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Weight.ball([0, 0, 0], 0.0), "radius"),
        (lambda: Weight.ball([0, 0, 0], 1e-200), "radius must be at least 1e-09 m, got 1e-200"),
        (lambda: Weight.ball([0, 0, 0], 10**400), "radius is 1000.*; expected a number"),
        (lambda: Weight.constant(10**400), "s is 1000.*; expected a number"),
        (lambda: Weight.speed(0.3, 0.2), "low < high"),
        (lambda: Weight.constant(np.nan), "finite"),
        (lambda: Weight((0.0, 0.0, 0.0, 0.0, 0.0, np.inf)), "finite"),
        (lambda: Weight((0.0,)), "expected a weight made by constant"),
        (lambda: Weight((9.0, 0.0, 0.0, 0.0, 0.0, 0.0)), "expected a weight made by constant"),
        (lambda: A / 0, "divided by 0; expected another number"),
        (lambda: A / "2", "a divisor of a field is '2'; expected a number"),
        (lambda: A - 1, "the other field is 1; expected Law"),
        (lambda: 1 + A, "a field was added to 1; expected another field"),
        (lambda: A.limited(-1.0), "force must be at least 0 N"),
        (lambda: Program(A.ops[:0], A.params, A.memory, A.kernels, A.laws), "must leave one wrench"),
        (lambda: Program(A.ops, A.params, A.memory, (), A.laws), "got 0 kernels and 1 laws"),
        (lambda: PythonLaw(lambda hand: 1.0).wrench(HAND), r"gave numbers of shape \(\); expected a force of three"),
        (lambda: PythonLaw(lambda hand: [0.0, np.inf, 0.0]).wrench(HAND), "expected finite numbers"),
    ],
)
def test_invalid_weights_limits_and_operands_raise_parameter_error(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
