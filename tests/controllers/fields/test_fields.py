"""FOLLOW, the bunny and their programs: closed forms, continuity, limits and validation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves.closest_point import closest_phase
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.instructions import TRACE_ATTRACTOR, TRACE_DISTANCE, TRACE_PHASE, TRACE_POINT, TRACE_ROW
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import evaluate
from controllers.fields.algebra.weights import window
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.own.own_law import PythonLaw
from controllers.state import HandState
from tests.derivatives import central_differences

CIRCLE = Trajectory.circle(0.05, 4.0)
SPEED = 2.0 * np.pi * 0.05 / 4.0


def _run(program, hand, memory):
    wrench = np.empty(6)
    evaluate(*program.compiled(), memory, hand.vector(), wrench)
    return wrench


def test_window_leaves_its_edge_with_zero_value_slope_and_curvature():
    assert window(0.0) == 1.0
    assert window(1.0) == window(4.0) == window(np.inf) == 0.0
    h = 1e-4
    value = [window(s * s) for s in (1 - h, 1.0, 1 + h)]
    assert abs(value[0]) / h**2 < 10 * h  # so the second derivative tends to zero at the edge
    assert value[1:] == [0.0, 0.0]


def test_follow_on_a_circle_matches_closed_form():
    rng = np.random.default_rng(0)
    follow = Follow(CIRCLE, k_r=200.0, b_d=4.0, epsilon=0.1)
    for _ in range(50):
        angle, radius, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.02, 0.09), rng.uniform(-0.03, 0.03)
        radial, along = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        v = rng.normal(size=3) * 0.1
        p = radius * radial + [0, 0, height]
        square = ((radius - 0.05) ** 2 + height**2) / 0.1**2
        expected = max(0.0, 1 - square) ** 3 * (200.0 * (0.05 * radial - p) + 4.0 * (SPEED * along - v))
        np.testing.assert_allclose(follow.wrench(HandState.at(p, v)).force, expected, atol=1e-4)


def test_hand_moving_with_the_curve_feels_no_force():
    follow = Follow(CIRCLE, k_r=200.0, b_d=4.0)
    for t in np.linspace(0.0, 4.0, 17):
        force = follow.wrench(HandState.at(CIRCLE.point(t), CIRCLE.velocity(t))).force
        assert np.abs(force).max() < 1e-12


def test_parallel_flow_keeps_the_pace_beside_the_curve_unlike_the_papers():
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, 4.0, 41)
    bent = np.column_stack([0.05 * np.cos(np.pi * t / 2), 0.04 * np.sin(np.pi * t / 2), 0.02 * np.cos(np.pi * t)])
    curve = Trajectory(t, bent, periodic=True)
    rates = np.empty((2, 40))
    for k, phase in enumerate(rng.uniform(0.0, 4.0, 40)):
        v, normal = curve.velocity(phase), np.cross(curve.velocity(phase), rng.normal(size=3))
        p = curve.point(phase) + 0.2 / float(curve.curvature(phase)) * normal / np.linalg.norm(normal)
        for row, parallel in zip(rates, (True, False), strict=True):
            law = Follow(curve, k_r=200.0, b_d=4.0, epsilon=np.inf, parallel=parallel)
            # The velocity at which the damper gives no force along the curve, and the rate of the nearest phase at it.
            along = law.wrench(HandState.at(p)).force @ v / (4.0 * v @ v) * v

            def phase_at(h, p=p, along=along, phase=phase):
                return closest_phase(curve.packed(), 0, *(p + h * along), phase)[0]

            row[k] = central_differences(phase_at, 0.0, 1e-4)
    np.testing.assert_allclose(rates[0], 1.0, atol=1e-5)
    assert np.abs(rates[1] - 1.0).max() > 0.15


@pytest.mark.parametrize(("radius", "pace"), [(0.03, 0.6), (0.01, 0.5), (0.07, 1.4), (0.2, 1.5)])
def test_parallel_flow_turns_with_the_circle_up_to_its_bounds(radius, pace):
    law = Follow(CIRCLE, k_r=200.0, b_d=4.0, epsilon=np.inf, parallel=True)
    force = law.wrench(HandState.at(np.array([radius, 0.0, 0.0]))).force
    np.testing.assert_allclose(force, [200.0 * (0.05 - radius), 4.0 * pace * SPEED, 0.0], atol=1e-4)


def test_a_parallel_flow_does_not_scale_what_compensates_for_friction():
    # A hand 10 mm outside a circle has 1.2 of its speed; a friction of 0.1 N takes 0.1/4 m/s, wherever the hand is.
    friction, b_d = 0.1, 4.0
    course = Trajectory.circle(0.05, 4.0 * SPEED / (SPEED + friction / b_d))
    law = Follow(course, 200.0, b_d, np.inf, True, compensation=friction / b_d / (SPEED + friction / b_d))
    hand = HandState.at(np.array([0.06, 0.0, 0.0]), np.array([0.0, 1.2 * SPEED, 0.0]))
    assert law.wrench(hand).force[1] == pytest.approx(friction, abs=1e-4)


def test_force_is_continuous_along_lines_through_the_tube():
    rng = np.random.default_rng(1)
    # A tube inside the reach: there the closest point is unique, so the law must be continuous everywhere.
    program = Follow(CIRCLE, k_r=200.0, b_d=4.0, epsilon=0.03).program()
    for _ in range(20):
        start = CIRCLE.point(rng.uniform(0, 4)) + rng.uniform(-0.04, 0.04, 3)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        memory = program.fresh_memory()
        forces = []
        for s in np.linspace(0.0, 0.08, 200):
            # Two evaluations 1e-12 m apart: a Lipschitz law differs by less than 1e-8, a jump stays.
            pair = [_run(program, HandState.at(start + (s + d) * direction), memory)[:3] for d in (0.0, 1e-12)]
            assert np.abs(pair[1] - pair[0]).max() < 1e-9
            forces.append(pair[0])
        # Between points 0.4 mm apart a force of stiffness k and at most 12 N changes little.
        assert np.abs(np.diff(forces, axis=0)).max() < 1.0


@settings(max_examples=100)
@given(st.tuples(*[st.floats(-1e9, 1e9)] * 3), st.tuples(*[st.floats(-1e3, 1e3)] * 3), st.floats(0, 1e6))
def test_force_of_every_law_is_finite_everywhere(p, v, t):
    for law in LAWS:
        assert np.isfinite(law.wrench(HandState.at(p, v, t)).force).all()


LAWS = [
    Follow(CIRCLE, 200.0, 4.0),
    *(Bunny(CIRCLE, 200.0, 4.0, 0.02, form, pace) for form in ("point", "along") for pace in ("clock", "wait")),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_force_on_the_medial_axis_and_at_rest_is_finite(law):
    for p in ([0.0, 0.0, 0.0], [0.0, 0.0, 0.03], [0.05, 0.0, 0.0]):
        assert np.isfinite(law.wrench(HandState.at(p)).force).all()


def test_non_finite_hand_gives_non_finite_force():
    program = LAWS[0].program()
    memory = program.fresh_memory()
    assert np.isnan(_run(program, HandState.at([np.nan, 0, 0]), memory)[:3]).all()
    for bunny in LAWS[1:]:
        assert not np.isfinite(bunny.wrench(HandState.at([0.05, np.inf, 0])).force).all()
    assert np.isnan(LAWS[1].wrench(HandState.at([0.05, 0, 0], t=np.nan)).force).all()
    assert np.isfinite(_run(program, HandState.at([0.05, 0, 0]), memory)).all()


def test_bunny_is_a_spring_and_damper_weighted_by_a_gaussian():
    bunny = Bunny(CIRCLE, 200.0, 4.0, 0.02, "point", "clock")
    p, v, t = np.array([0.03, 0.03, 0.01]), np.array([0.1, -0.2, 0.0]), 4.0 + 0.7
    away = CIRCLE.point(t) - p
    expected = np.exp(-(away @ away) / (2 * 0.02**2)) * (200.0 * away + 4.0 * (CIRCLE.velocity(t) - v))
    np.testing.assert_allclose(bunny.wrench(HandState.at(p, v, t)).force, expected, rtol=1e-12)


def _bunny_phases(pace, hands):
    program = Bunny(CIRCLE, 200.0, 4.0, 0.02, "point", pace).program()
    memory, phases = program.fresh_memory(), []
    for k, p in enumerate(hands):
        _run(program, HandState.at(p, t=k * 1e-3), memory)
        phases.append(memory[TRACE_ATTRACTOR])
    return np.array(phases)


def test_clocked_bunny_runs_on_and_waiting_bunny_waits_for_a_held_hand():
    held = [CIRCLE.point(0.5)] * 3000
    clock, waits = _bunny_phases("clock", held), _bunny_phases("wait", held)
    np.testing.assert_allclose(clock, np.arange(3000) * 1e-3, atol=1e-12)
    assert waits[0] == pytest.approx(0.5, abs=1e-9)
    # It slows down as it gets away: ṡ = exp(−s²V²/2δ²), so it takes ever longer for each further δ.
    lead = (waits - 0.5) * SPEED / 0.02
    assert (np.diff(waits) >= 0.0).all()
    assert 1.5 < lead[-1] < 3.0
    assert np.diff(waits)[-1] < 0.2e-3


def test_waiting_bunny_keeps_pace_with_a_hand_that_keeps_up():
    moving = [CIRCLE.point(0.5 + k * 1e-3) for k in range(5000)]
    phases = _bunny_phases("wait", moving)
    assert np.linalg.norm(CIRCLE.point(phases) - moving, axis=1).max() < 1e-4


def test_programs_add_and_external_wrench_enters_the_sum():
    inner, outer = Trajectory.circle(0.03, 2.0), Trajectory.circle(0.07, 3.0)
    laws = [Follow(inner, 100.0, 1.0), Follow(outer, 50.0, 2.0), Bunny(outer, 30.0, 1.0, 0.05)]
    hand = HandState.at([0.045, 0.01, 0.0], [0.0, 0.1, 0.0], 0.3)
    external = PythonLaw(lambda hand: hand.p).program()
    program = laws[0].program() + (external + laws[1].program()) + laws[2].program()
    memory = program.fresh_memory()
    ((_, slot),) = program.python_feeds
    memory[slot : slot + 6] = [1, 2, 3, 4, 5, 6]
    wrench = _run(program, hand, memory)
    force = sum(law.wrench(hand).force for law in laws)
    np.testing.assert_allclose(wrench, np.concatenate([force + np.array([1, 2, 3]), [4, 5, 6]]), rtol=1e-14)
    # The trace is of the nearest curve, here the inner one.
    assert memory[TRACE_ROW] == 0
    distance = np.hypot(0.045, 0.01) - 0.03
    assert memory[TRACE_DISTANCE] == pytest.approx(distance, abs=1e-7)
    np.testing.assert_allclose(memory[TRACE_POINT : TRACE_POINT + 3], inner.point(memory[TRACE_PHASE]), atol=1e-15)


def test_warm_started_memory_does_not_change_the_force():
    program = Follow(CIRCLE, 200.0, 4.0).program()
    memory = program.fresh_memory()
    for t in np.linspace(0, 4, 50):
        hand = HandState.at(CIRCLE.point(t) * 1.3, [0.1, 0, 0])
        np.testing.assert_allclose(_run(program, hand, memory), _run(program, hand, program.fresh_memory()), atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Follow(CIRCLE, -1.0, 1.0), "k_r must be finite and at least 0 N/m, got -1.0"),
        (lambda: Follow(CIRCLE, 1.0, np.inf), "b_d"),
        (lambda: Follow(CIRCLE, 1.0, 1.0, epsilon=0.0), "epsilon must be at least 0.0001 m, got 0.0"),
        (lambda: Bunny(CIRCLE, 1.0, np.nan, 0.1), "b_d"),
        (lambda: Bunny(CIRCLE, 1.0, 1.0, 0.0), "delta"),
        (
            lambda: Bunny(CIRCLE, 1.0, 1.0, 0.1, "sideways"),
            "attraction is 'sideways'; expected one of point, along, convolution",
        ),
        (lambda: Program(np.zeros((0, 4), np.int64), np.zeros(0), np.zeros(8)), "one wrench"),
    ],
)
def test_invalid_gains_raise_parameter_error(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


@pytest.mark.parametrize("law", LAWS[:2], ids=["follow", "bunny by the clock"])
def test_released_mass_traces_the_curve_at_its_pace(law):
    program, mass, period = law.program(), 0.1, 1e-3
    memory = program.fresh_memory()
    p, v = CIRCLE.point(0.0) + np.array([0.008, 0.0, 0.005]), np.zeros(3)
    path = []
    for k in range(8000):
        force = _run(program, HandState.at(p, v, k * period), memory)[:3]
        v = v + period * force / mass
        p = p + period * v
        path.append(memory[TRACE_PHASE])
        if k > 1000:
            # The centripetal force m v²/R = 12 mN takes 0.06 mm of the spring.
            assert memory[TRACE_DISTANCE] < 1.5e-4
    laps = np.unwrap(np.array(path) * 2 * np.pi / 4.0) / (2 * np.pi)
    assert laps[-1] - laps[2000] == pytest.approx(6.0 / 4.0, rel=0.01)
