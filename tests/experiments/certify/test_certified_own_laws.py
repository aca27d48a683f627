"""Certificates of a user's own laws: all cases are covered, no oscillating law is certified, and reasons are true."""

import dataclasses
import math
import re

import numpy as np
import pytest

import hvf
from controllers.certificates.loop.case_hull import slopes_of
from controllers.certificates.loop.hand import NO_HANDS
from controllers.certificates.loop.law_cases import cases_of, certified_cases
from controllers.errors import ControllerError, ParameterError
from controllers.state import HandState

CURVE = hvf.circle(radius=0.0477, lap=4.0)
CURVE_STATES = np.hstack([CURVE.point(np.linspace(0.0, 3.9, 40)), CURVE.velocity(np.linspace(0.0, 3.9, 40))])


def simulation(law):
    return hvf.Simulation(
        field=hvf.Follow(CURVE, k_r=300.0, b_d=8.0) + law,
        haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=CURVE),
        figure=hvf.Figure(kind="none"),
    )


def stability(function, compiled=False, hands=NO_HANDS):
    law = hvf.law(compiled=True)(function) if compiled else hvf.law(function)
    return hvf.certify(simulation(law), hands).stability


def rail(hand, k=2e4):
    r = math.hypot(hand.p[0], hand.p[1])
    return (0.0, 0.0, -k * hand.p[2]) if 0.04 < r < 0.06 else (0.0, 0.0, 0.0)


def numpy_rail(hand, k=2e4):
    r = np.hypot(hand.p[0], hand.p[1])
    return (0.0, 0.0, -k * hand.p[2]) if 0.04 < r < 0.06 else (0.0, 0.0, 0.0)


def saturated(hand, k=2e4):
    return 0.0, 0.0, max(-5.0, min(5.0, -k * float(hand.p[2])))


def catching_errors(hand, k=2e4):
    try:
        z = float(hand.p[2])
    except Exception:
        z = 0.0
    return 0.0, 0.0, -k * z


def checking_type(hand, k=2e4):
    return (0.0, 0.0, -k * hand.p[2]) if isinstance(hand.p[2], float) else (0.0, 0.0, 0.0)


def zero_on_curve(hand, k=2e4):
    return (0.0, 0.0, -k * hand.p[2]) if abs(hand.p[2]) > 1e-4 else (0.0, 0.0, 0.0)


def steep_off_curve(hand, k=2e4):
    """No stiffness on the curve, full stiffness a few hundredths of a millimetre off it."""
    return 0.0, 0.0, -k * hand.p[2] * (1.0 - np.exp(-((hand.p[2] / 1e-5) ** 2)))


def relay(hand, c=1.0):
    return 0.0, 0.0, (-c if hand.p[2] > 0.0 else c)


def dry_friction(hand, c=0.5):
    return 0.0, 0.0, -c * np.sign(hand.v[2])


def damped(hand, b=100.0):
    return -b * hand.v


def floor(hand, k=500.0, b=3.0):
    depth = -1e-3 - hand.p[2]
    return (0, 0, max(0.0, k * depth - b * hand.v[2])) if depth > 0 else (0, 0, 0)


def sticking_floor(hand, k=500.0, b=3.0):
    depth = -1e-3 - hand.p[2]
    return (0, 0, k * depth - b * hand.v[2]) if depth > 0 else (0, 0, 0)


def step(hand):
    return (0.1 if hand.p[0] > 0 else 0.0), 0, 0


def switching_spring(hand, k=900.0):
    return (0, 0, -k * hand.p[2]) if hand.p[2] * hand.v[2] > 0 else (0, 0, 0.25 * k * hand.p[2])


# Laws that oscillate are never certified.


@pytest.mark.parametrize(
    "function",
    [
        rail,
        saturated,
        catching_errors,
        checking_type,
        numpy_rail,
        zero_on_curve,
        steep_off_curve,
        relay,
        dry_friction,
        damped,
    ],
)
def test_law_that_oscillates_in_simulation_is_not_certified(function):
    assert "It oscillates" in str(simulation(hvf.law(function)).run(1.0))
    assert stability(function).verdict != "certified"


@pytest.mark.parametrize("compiled", [False, True])
def test_law_that_converts_to_float_is_refuted_by_linearisation_or_unknown(compiled):
    found = stability(rail, compiled)
    assert found.verdict == "refuted"
    assert "mm off the curve at phase" in found.reason
    assert "to a plain one" in found.reason
    assert "np.hypot" in found.reason
    # Linearisation at sampled states can refute but not certify: the same law with a soft spring is unknown.
    soft = hvf.certify(simulation(hvf.law(rail)(k=100.0)), NO_HANDS).stability
    assert soft.verdict == "unknown"
    assert "to a plain one" in soft.reason


def test_symbolic_law_that_differs_from_executed_law_is_rejected():
    with pytest.raises(ControllerError, match="another force in a run than symbolically, as for a hand at p = "):
        certified_cases(hvf.law(checking_type), CURVE)
    with pytest.raises(ControllerError, match="numbers that are not finite"):
        certified_cases(hvf.law(lambda hand: (math.nan, 0, 0)), CURVE)
    state = [0.0]

    def filtered(hand):
        state[0] = 0.9 * state[0] + 0.1 * hand.p[2]
        return 0, 0, -state[0]

    with pytest.raises(ControllerError, match="another force when called again"):
        certified_cases(hvf.law(filtered), CURVE)


# Discontinuous forces.


def test_small_force_step_is_unknown_not_refuted():
    found = stability(step)
    assert found.verdict == "unknown"
    assert "where it jumps" in found.reason
    assert "its force jumps, is kinked or is no number" in found.reason


# Piecewise laws: every case counts.


@pytest.mark.slow
def test_states_with_saturated_force_are_excluded_from_linearisation():
    """A plane of 8 kN/m reaches the limit of 8 N at 1 mm: beyond, the loop has no stiffness or damping."""
    plane = hvf.law(lambda hand, k=8000.0: (0.0, 0.0, -k * hand.p[2]))
    sim = simulation(plane)
    saturated, in_part = (
        dataclasses.replace(sim, field=field)
        for field in (sim.field.limited(8.0), hvf.Follow(CURVE, k_r=300.0, b_d=8.0).limited(0.5) + plane)
    )
    free, less, part = (hvf.certify(variant, NO_HANDS).stability for variant in (sim, saturated, in_part))
    whole, judged = (int(re.findall(r"grows at (\d+) states", verdict.reason)[0]) for verdict in (free, less))
    assert less.verdict == "certified"
    assert judged < whole
    # Where only a part of the field is limited, the plane acts without the damping of FOLLOW.
    assert part.verdict == "refuted"


@pytest.mark.slow
def test_readme_floor_is_certified_in_both_cases_for_all_hands():
    found = hvf.certify(simulation(hvf.law(floor))).stability
    assert found.verdict == "certified"
    assert "the least of 2 cases" in found.reason
    plain = hvf.certify(hvf.Simulation(
        field=hvf.Follow(CURVE, k_r=300.0, b_d=8.0), haptic_map=simulation(hvf.law(floor)).haptic_map,
        figure=hvf.Figure(kind="none"),
    ))  # fmt: skip
    assert found.margin < 0.7 * plain.stability.margin


@pytest.mark.slow
def test_floor_verdict_is_that_of_its_stiffest_case():
    assert stability(floor).verdict == "certified"
    hard = hvf.certify(simulation(hvf.law(floor)(k=2e4)), NO_HANDS).stability
    assert hard.verdict == "refuted"
    assert "in one of 2 cases" in hard.reason


@pytest.mark.slow
def test_stable_cases_with_uncertified_switching_are_unknown():
    found = hvf.certify(simulation(hvf.law(switching_spring))).stability
    assert found.verdict == "unknown"
    assert "switching between them is not certified" in found.reason


def test_case_slopes_bound_the_force_around_the_curve():
    kinds = {floor: 2, step: 0, sticking_floor: 0, relay: 0, zero_on_curve: 2, numpy_rail: 2}
    for function, count in kinds.items():
        cases = cases_of(hvf.law(function))
        if not count:
            with pytest.raises(ControllerError, match="no stiffness and damping"):
                slopes_of(cases, CURVE_STATES)
            continue
        assert len(slopes_of(cases, CURVE_STATES)) == count
    soft, stiff = sorted(slopes_of(cases_of(hvf.law(floor)), CURVE_STATES), key=lambda slope: np.abs(slope).max())
    rng = np.random.default_rng(1)
    for off in rng.normal(scale=(3e-3,) * 3 + (0.05,) * 3, size=(200, 6)):
        hand = CURVE_STATES[0] + off
        force = hvf.law(floor).wrench(HandState.at(hand[:3], hand[3:])).force[2]
        ends = sorted((float(soft[2] @ off), float(stiff[2] @ off)))
        assert ends[0] - 1e-12 <= force <= ends[1] + 1e-12


@pytest.mark.slow
def test_law_with_vector_arithmetic_is_certified():
    def spring(hand, k=50.0, b=1.0):
        return -k * hand.p - b * hand.v

    def dragged(hand, b=1.0):
        return -b * hand.v * hand.v.dot(hand.v)

    def pulled(hand, k=10.0):
        return -k * np.linalg.norm(hand.p), 0.0, 0.0

    for function in (spring, dragged, pulled):
        assert stability(function).verdict == "certified", function


def test_force_without_derivative_on_the_curve_is_unknown():
    found = stability(lambda hand: (0, 0, -300.0 * np.sqrt(hand.p[2] ** 2)))
    assert found.verdict == "unknown"
    assert "has a kink without a comparison" in found.reason


def test_all_feasible_branches_become_cases_up_to_a_limit():
    assert len(cases_of(hvf.law(dry_friction)).cases) == 3
    assert len(cases_of(hvf.law(floor)).cases) == 3
    with pytest.raises(ControllerError, match="more than 16 cases"):
        cases_of(hvf.law(lambda hand: np.clip(-300.0 * hand.p, -1.0, 1.0)))
    with pytest.raises(ControllerError, match="compares numbers of the hand more than"):
        cases_of(hvf.law(_endless))
    with pytest.raises(ControllerError, match="depends on the switch"):
        cases_of(hvf.law(lambda hand: (0, 0, 1.0) if hand.switch else (0, 0, 0)))


def _endless(hand):
    x = hand.p[0]
    while x < 1.0:
        x = x + 1e-3
    return x, 0, 0


# Invalid laws.


def _boom(hand):
    raise ValueError("boom")


def test_cases_that_differ_beyond_the_sixth_digit_are_distinct():
    """CasADi prints six digits of a number: compared as text, the cases of this law would be one smooth expression."""

    def notched(hand, k=1e6):
        if hand.p[2] > 0.12345671:
            return 0.0, 0.0, -k * (hand.p[2] - 0.12345671)
        return (0.0, 0.0, -k * (hand.p[2] - 0.12345672)) if hand.p[2] > 0.12345672 else (0.0, 0.0, 0.0)

    cases = cases_of(hvf.law(notched))
    assert len(cases.cases) == 3
    assert not cases.smooth


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (_boom, r"law _boom \(.*\) raised ValueError: boom"),
        (lambda hand: (1.0 / (hand.t - hand.t), 0, 0), "raised ZeroDivisionError"),
    ],
)
def test_law_that_raises_is_named_in_the_error(function, message):
    with pytest.raises(ParameterError, match=message):
        stability(function)


def test_reasons_contain_no_library_paths():
    for function in (rail, step):
        assert ".cpp" not in stability(function).reason


@pytest.mark.parametrize("delay", [1, 1000])  # fewer and more calls than there are sampled hand states
@pytest.mark.slow
def test_law_with_internal_state_is_unknown_every_time(delay: int) -> None:
    queue = [0.0] * delay

    @hvf.law
    def delayed(hand, k=50.0):
        queue.append(hand.p[2])
        return 0.0, 0.0, -k * queue.pop(0)

    sim, message = simulation(delayed), "another force when called again|keeps numbers of the hand between calls"
    for _ in range(2):
        found = hvf.certify(sim).stability
        assert found.verdict == "unknown"
        assert re.search(message, found.reason), found.reason


def test_law_that_stores_a_symbol_is_reported_as_stateful() -> None:
    kept = [0.0]

    @hvf.law
    def late(hand):
        kept.append(hand.p[2])
        return 0.0, 0.0, kept.pop(0)

    cases_of(late)
    with pytest.raises(ControllerError, match=r"law late .* keeps numbers of the hand between calls"):
        certified_cases(late, CURVE)


def verdicts(field):
    certificate = hvf.certify(dataclasses.replace(simulation(damped_law), field=field), NO_HANDS)
    return certificate.stability, certificate.passivity


FOLLOW = hvf.Follow(CURVE, k_r=300.0, b_d=8.0)
damped_law = hvf.law(damped)
floor_law = hvf.law(floor)


@pytest.mark.parametrize(
    ("scaled", "plain"),
    [
        (2 * FOLLOW, hvf.Follow(CURVE, k_r=600.0, b_d=16.0)),
        (FOLLOW / 2, hvf.Follow(CURVE, k_r=150.0, b_d=4.0)),
        (FOLLOW.gated(~hvf.Weight.constant(0.25)), hvf.Follow(CURVE, k_r=225.0, b_d=6.0)),
        (FOLLOW - -0.5 * damped_law(b=2.0), FOLLOW + damped_law(b=1.0)),
        (0.5 * (FOLLOW + floor_law(k=300.0, b=4.0)), hvf.Follow(CURVE, k_r=150.0, b_d=4.0) + floor_law(k=150.0, b=2.0)),
        (2 * FOLLOW.limited(4.0), hvf.Follow(CURVE, k_r=600.0, b_d=16.0).limited(8.0)),
    ],
)
@pytest.mark.slow
def test_scaled_field_is_certified_as_field_with_scaled_gains(scaled, plain):
    for of_scaled, of_plain in zip(verdicts(scaled), verdicts(plain), strict=True):
        assert of_scaled.verdict == of_plain.verdict != "unknown"
        assert of_scaled.margin == pytest.approx(of_plain.margin, rel=1e-9)
        assert of_scaled.assumptions == of_plain.assumptions


def test_negated_field_is_refuted_by_linearisation_of_executed_program():
    certificate = hvf.certify(dataclasses.replace(simulation(damped_law), field=-FOLLOW))
    assert certificate.stability.verdict == "refuted"
    assert certificate.passivity.verdict == "unknown"
    assert "Follow times -1, which leads the hand away" in certificate.passivity.reason
