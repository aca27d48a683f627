"""User-defined laws: identical in Python and compiled, with named parameters and a digest of their code."""

import math
import threading
from fractions import Fraction

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.description import code_digest
from controllers.fields.algebra.weights import Weight
from controllers.fields.follow import Follow
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.own.own_law import law
from controllers.state import HandState
from tests.controllers.fields.field_probes import run_over

RNG = np.random.default_rng(7)
SOFTNESS = 1e-3
MASKED = np.ma.masked_greater([0.0, 1.0, 2.0], 1.5)


def floor(hand, k=500.0, b=3.0):
    depth = -1e-3 - hand.p[2]
    return (0, 0, max(0.0, k * depth - b * hand.v[2])) if depth > 0 else (0, 0, 0)


def limited(hand, force=1.0):
    return force, 0.0, 0.0


def reading(hand):
    with open("force") as file:
        return file.read(), 0.0, 0.0


class Springy:
    def __call__(self, hand):
        return hand.p


def twisted(hand, k=0.2, d=0.01):
    """A moment towards the upright stylus, and a force while the switch is closed."""
    w, x, y, z = hand.q
    return (
        0.1 * hand.switch, math.sin(hand.t), -k * hand.v[1],
        -k * x * w - d * hand.w[0], -k * y - d * hand.w[1], -k * z - d * hand.w[2],
    )  # fmt: skip


def smooth_floor(hand, k=500.0, b=3.0):
    depth = -1e-3 - hand.p[2]
    deep = 0.5 * (depth + np.sqrt(depth * depth + SOFTNESS * SOFTNESS))
    return 0.0, 0.0, deep * (k - b * hand.v[2])


def hands(n=300):
    for _ in range(n):
        q = RNG.normal(size=4)
        yield HandState(
            float(RNG.uniform(0.0, 5.0)), RNG.normal(scale=5e-3, size=3), q / np.linalg.norm(q),
            RNG.normal(scale=0.1, size=3), RNG.normal(size=3), bool(RNG.random() > 0.5),
        )  # fmt: skip


@pytest.mark.parametrize("function", [floor, twisted, smooth_floor])
def test_compiled_and_python_law_give_identical_wrenches(function):
    plain, compiled = law(function), law(compiled=True)(function)
    for hand in hands():
        np.testing.assert_array_equal(np.concatenate(compiled.wrench(hand)), np.concatenate(plain.wrench(hand)))


def test_law_may_return_a_moment():
    hand = HandState.at([0.0, 0.0, 0.0])._replace(w=np.array([1.0, 2.0, 3.0]))
    for own in (law(twisted), law(compiled=True)(twisted)):
        np.testing.assert_allclose(own.wrench(hand).torque, [-0.01, -0.02, -0.03])
        np.testing.assert_allclose((own(k=0.0, d=1.0) + own).wrench(hand).torque, [-1.01, -2.02, -3.03])


def test_parameters_are_named_and_overridden_in_a_new_law():
    for own in (law(floor), law(compiled=True)(floor)):
        assert repr(own) == "floor(k=500.0, b=3.0)"
        soft = own(k=100)
        assert (repr(soft), repr(own)) == ("floor(k=100, b=3.0)", "floor(k=500.0, b=3.0)")
        deep = HandState.at([0.0, 0.0, -0.011])
        assert soft.wrench(deep).force[2] == pytest.approx(1.0)
        assert own.wrench(deep).force[2] == pytest.approx(5.0)


def test_fraction_is_accepted_as_parameter():
    own = law(floor)(k=Fraction(1, 4))
    assert repr(own) == "floor(k=0.25, b=3.0)"
    assert own.wrench(HandState.at([0.0, 0.0, -0.011])).force[2] == pytest.approx(0.0025)


def test_laws_with_other_parameters_share_one_kernel():
    own = law(compiled=True)(floor)
    program = (own + own(k=100.0)).limited(8.0)
    assert len(program.kernels) == 1
    assert len(program.laws) == 2
    assert program.wrench(HandState.at([0.0, 0.0, -0.011])).force[2] == pytest.approx(6.0)


def test_law_without_parameters_may_be_compiled_by_numba_already():
    from numba import njit

    @law(compiled=True)
    @njit
    def push(hand):
        return 1, 0.5, hand.t

    assert isinstance(push, CompiledLaw)
    np.testing.assert_array_equal(push.wrench(HandState.at([0.0, 0.0, 0.0], t=2.0)).force, [1.0, 0.5, 2.0])


def test_law_composes_with_builtin_and_python_laws():
    river = Follow(Trajectory.circle(0.05, 4.0), 200.0, 4.0)
    compiled, plain = law(compiled=True)(floor), law(twisted)
    field = (river + compiled(k=300.0)).blended(2.0 * plain, Weight.constant(0.25)).limited(3.0, 0.02)
    for hand in hands(50):
        parts = [np.concatenate(part.wrench(hand)) for part in (river, compiled(k=300.0), plain)]
        total = 0.75 * (parts[0] + parts[1]) + 0.5 * parts[2]
        for part, most in ((total[:3], 3.0), (total[3:], 0.02)):
            part *= min(1.0, most / np.linalg.norm(part))
        np.testing.assert_allclose(np.concatenate(field.wrench(hand)), total, rtol=1e-12, atol=1e-15)


def test_law_that_changes_the_hand_changes_it_for_itself_alone():
    def careless(hand):
        hand.p[:] = 5.0
        return hand.p

    hand = HandState.at([0.04, 0.01, 0.02])
    both = law(careless) + law(floor) + law(smooth_floor)
    np.testing.assert_array_equal(both.wrench(hand).force, (law(floor) + law(smooth_floor)).wrench(hand).force + 5.0)
    assert hand.p.tolist() == [0.04, 0.01, 0.02]


def test_compiled_loop_evaluates_law_every_tick():
    program = law(compiled=True)(floor).program()
    rows = [hand.vector() for hand in hands(100)]
    wrenches = np.empty((100, 6))
    run_over(*program.compiled(), program.fresh_memory(), np.array(rows), wrenches)
    expected = [floor(HandState.of(row)) for row in rows]
    np.testing.assert_array_equal(wrenches[:, :3], expected)


def test_division_by_zero_reaches_the_limiter_as_infinity():
    pole = law(compiled=True)(lambda hand: (1.0 / hand.p[0], 0.0, 0.0))
    wrenches = np.empty((1, 6))
    program, hand = pole.program(), HandState.at([0.0, 0.0, 0.0])
    run_over(*program.compiled(), program.fresh_memory(), hand.vector()[None], wrenches)
    assert np.isinf(wrenches[0, 0])
    with pytest.raises(ParameterError, match="expected finite numbers"):
        pole.wrench(hand)


def test_exception_in_compiled_law_is_reported_with_its_name_and_hand():
    def beyond(hand):
        total = 0.0
        for i in range(int(hand.t)):
            total += hand.p[i]
        return total, 0.0, 0.0

    own = law(compiled=True)(beyond)
    assert own.wrench(HandState.at([1.0, 2.0, 3.0], t=3.0)).force[0] == 6.0
    with pytest.raises(
        ParameterError, match=r"law beyond \(.*\) raised IndexError: .*; for a hand at p = \[1\.0, 2\.0, 3"
    ):
        own.wrench(HandState.at([1.0, 2.0, 3.0], t=4.0))


def test_description_contains_name_parameters_and_code_digest():
    def described(function, **parameters):
        return law(function)(**parameters).description()

    assert described(floor)["law"] == "floor"
    assert described(floor)["parameters"] == {"k": 500.0, "b": 3.0}
    assert described(floor, k=300.0)["parameters"] == {"k": 300.0, "b": 3.0}
    assert described(floor)["code"] == law(compiled=True)(floor).description()["code"]
    assert described(floor)["code"] != described(smooth_floor)["code"]


def test_code_digest_depends_on_closure_constants_and_functions():
    def digest(constant, slope):
        def deep(hand, depth):
            return slope * (depth - hand.p[2])

        def own(hand, k=1.0):
            return 0.0, 0.0, k * deep(hand, constant)

        return law(own).description()["code"]

    assert digest(1.0, 2.0) == digest(1.0, 2.0)
    assert len({digest(1.0, 2.0), digest(1.5, 2.0), digest(1.0, 2.5)}) == 3


@pytest.mark.parametrize(
    "body", ["return [gain * x for x in hand.p]", "return list(map(lambda x: gain * x, hand.p))", "return helper(hand)"]
)
def test_code_digest_depends_on_globals_read_within_and_on_keyword_defaults(body):
    def digest(gain):
        names = {"gain": gain}
        exec(f"def helper(hand, *, k={gain}):\n    return [k * x for x in hand.p]\ndef own(hand):\n    {body}", names)
        return code_digest(names["own"])

    assert digest(1.0) == digest(1.0) != digest(2.0)


def test_code_digest_depends_on_container_contents_and_differs_for_unreadable_objects():
    gains, table = [1.0], {"k": np.array([1.0, 2.0])}

    def own(hand):
        return 0.0, 0.0, gains[0] * table["k"][1] * hand.p[2]

    before = code_digest(own)
    assert code_digest(own) == before
    gains[0] = 2.0
    between = code_digest(own)
    table["k"][1] = 3.0
    assert len({before, between, code_digest(own)}) == 3
    lock = threading.Lock()

    def locked(hand):
        with lock:
            return 0.0, 0.0, hand.p[2]

    assert code_digest(locked) != code_digest(locked)


def test_description_of_composed_field_lists_operations_and_laws():
    river = Follow(Trajectory.circle(0.05, 4.0), 200.0, 4.0)
    description = (river + law(floor)).gated(Weight.switch()).limited(8.0).description()
    assert description["parameters"] == [8.0, np.inf]
    (gated,) = description["limit"]
    ((summed,),) = (gated["gate"],)
    first, second = summed["add"]
    assert (first["law"], second["law"]) == ("Follow", "floor")
    assert first["parameters"]["k_r"] == 200.0
    other = Follow(Trajectory.circle(0.051, 4.0), 200.0, 4.0).description()
    assert other["parameters"]["curve"] != first["parameters"]["curve"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: law(lambda: (0, 0, 0)), "first argument of law <lambda> .* must be hand, got no argument"),
        (lambda: law(lambda p, k=1.0: (0, 0, 0)), "must be hand, got p"),
        (lambda: law(lambda *hand: (0, 0, 0)), r"must be hand, got \*hand"),
        (lambda: law(lambda hand, /, k=1.0: (0, 0, 0)), r"hand of law <lambda> .* by position only; leave out the /"),
        (lambda: law(limited), r"law limited \(.*\) cannot be called limited: a sweep finds .*; expected another name"),
        (lambda: law(int), r"a law is made from a function law\(hand, …\); got <class 'int'>"),
        (lambda: law(lambda hand, k: (0, 0, 0)), r"argument k of law .* a number as its default, as in k=1.0"),
        (lambda: law(lambda hand, **more: (0, 0, 0)), "with a number as its default"),
        (lambda: law(lambda hand, k="stiff": (0, 0, 0)), "k of law .* must be a finite number, got 'stiff'"),
        (lambda: law(lambda hand, k=np.nan: (0, 0, 0)), "must be a finite number, got nan"),
        (lambda: law(lambda hand, k=10**400: (0, 0, 0)), r"must be a finite number, got 1000.*\.\.\."),
        (lambda: law(floor)(stiffness=3.0), "no parameter stiffness; there are k, b"),
        (lambda: law(floor)(k=np.inf), r"k of law floor \(.*test_own_law.py, line \d+\) must be a finite number"),
        (lambda: law(lambda hand: ("a", 0, 0)).wrench(HandState.at([0, 0, 0])), r"gave \('a', 0, 0\); expected"),
        (lambda: law(lambda hand: None).wrench(HandState.at([0, 0, 0])), r"law .* returned None; expected a return "),
        (lambda: law(lambda hand: ("1", "2", "3")).wrench(HandState.at([0, 0, 0])), r"gave \('1', '2', '3'\); exp"),
        (lambda: law(lambda hand: (1j, 0, 0)).wrench(HandState.at([0, 0, 0])), r"gave \(1j, 0, 0\); expected"),
        (lambda: law(lambda hand: (10**400, 0, 0)).wrench(HandState.at([0, 0, 0])), r"gave \(1000.*, 0, 0\); expected"),
        (lambda: law(lambda hand: MASKED).wrench(HandState.at([0, 0, 0])), "gave masked_array.*; expected"),
        (lambda: law(lambda hand: (0, 0)).wrench(HandState.at([0, 0, 0])), r"numbers of shape \(2,\)"),
        (lambda: law(compiled=True)(lambda hand: (0, 0)), "expected a tuple of three numbers"),
        (lambda: law(compiled=True)(lambda hand: np.zeros(3)), r"returns array\(float64, 1d, C\); expected a tuple"),
        (lambda: law(compiled=True)(lambda hand: ("a", 0, 0)), "expected a tuple of three numbers"),
        (lambda: law(compiled=True)(lambda hand: hand.p + hand.v), "gives six numbers compiled and three in Python"),
        (lambda: law(compiled=True)(lambda hand: (hand.x, 0, 0)), r"law <lambda> \(.*line \d+\) cannot be compiled"),
        (
            lambda: law(compiled=True)(lambda hand: (hand.x, 0, 0)),
            r": a hand has no x; it has t, p, q, v, w, switch\. Exp",
        ),
        (
            lambda: law(compiled=True)(lambda hand: (hand.p * 2, 0, 0)),
            r"no mul\(UniTuple.*\) for arguments of these types\. Exp",
        ),
        (
            lambda: law(compiled=True)(lambda hand: (np.nope(hand.t), 0, 0)),
            "cannot be compiled.* has no attribute 'nope'",
        ),
        (lambda: law(compiled=True)(reading), "cannot be compiled: The 'with"),
        (lambda: law(compiled=True)(Springy()), "law Springy cannot be compiled: The decorated object is not a fun"),
        (lambda: law(compiled=True)(lambda hand: (unknown, 0, 0)), "cannot be compiled.*unknown"),  # noqa: F821
    ],
)
def test_invalid_law_raises_parameter_error_with_name_and_place(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
