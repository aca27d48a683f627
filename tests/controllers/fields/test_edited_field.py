"""The edited field V + U: it reproduces performances as flow and as force, with weights, and can be stored."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.edited import Edited, performance
from controllers.fields.river import River, integrate
from controllers.state import HandState
from tests.controllers.fields.field_probes import largest_jump, mass_in, run_over

CIRCLE = Trajectory.circle(0.05, 4.0)
RIVER = River(CIRCLE, 0.08, 4.0 / 300.0, 4.0)
TIMES = np.arange(4000) * 1e-3


def _pushed(rng, peak):
    """Path and push of a mass in the river that is pushed once in a random direction."""
    direction = rng.normal(size=3)
    start, duration = rng.uniform(0.5, 2.0), rng.uniform(0.3, 1.0)
    bump = np.sin(np.pi * np.clip((TIMES - start) / duration, 0.0, 1.0)) ** 2
    push = peak * bump[:, None] * direction / np.linalg.norm(direction)
    path, _ = mass_in(RIVER.program(), CIRCLE.point(0.0), CIRCLE.velocity(0.0), push)
    return path, push


@pytest.mark.slow
def test_flow_integrates_to_the_performed_curve_for_random_pushes():
    rng = np.random.default_rng(0)
    for _ in range(20):
        path, _ = _pushed(rng, rng.uniform(0.5, 3.0))
        away = np.linalg.norm(path - CIRCLE.point(TIMES), axis=1).max()
        assert away > 2e-3
        edited = Edited(RIVER, (performance(TIMES, path),), (1.0,))
        course = integrate(edited.flow, path[0], TIMES[::17])
        # Not at the spline's own samples.
        error = np.linalg.norm(course - path[::17], axis=1)
        assert np.sqrt(np.mean(error**2)) < 1e-3
        assert error.max() < 1e-3


def test_light_mass_in_the_edited_field_traces_the_performed_curve():
    rng = np.random.default_rng(1)
    for _ in range(5):
        path, push = _pushed(rng, 2.0)
        program = Edited(RIVER, (performance(TIMES, path),), (1.0,)).program()
        errors = []
        for mass in (0.02, 0.01):
            again, _ = mass_in(program, path[0], CIRCLE.velocity(0.0), np.zeros_like(push), mass)
            errors.append(np.sqrt(np.mean(np.sum((again - path) ** 2, axis=1))))
        # The remaining error is due to the inertia.
        assert errors[1] < 1e-3
        assert errors[1] < 0.6 * errors[0]


def test_hand_on_the_performance_feels_nothing_and_u_equals_the_push():
    path, push = _pushed(np.random.default_rng(2), 2.0)
    performed = performance(TIMES, path)
    edited = Edited(RIVER, (performed,), (1.0,))
    for t in np.linspace(0.1, 3.9, 39):
        hand = HandState.at(performed.point(t), performed.velocity(t), t)
        assert np.abs(edited.wrench(hand).force).max() < 1e-9
        felt = edited.wrench(hand).force - RIVER.wrench(hand).force
        inertia = 0.1 * performed.acceleration(t)
        # The push less the force that accelerated the mass.
        np.testing.assert_allclose(felt, push[round(1e3 * t)] - inertia, atol=0.1)


def test_recordings_add_with_their_weights():
    rng = np.random.default_rng(3)
    one, two = (performance(TIMES, _pushed(rng, 2.0)[0]) for _ in range(2))
    both = Edited(RIVER, (one, two), (0.5, -2.0))
    for _ in range(20):
        t = rng.uniform(0.0, 4.0)
        p, v = CIRCLE.point(t) + rng.normal(size=3) * 0.003, rng.normal(size=3) * 0.1
        hand, alone = HandState.at(p, v, t), RIVER.wrench(HandState.at(p, v, t)).force
        parts = [Edited(RIVER, (curve,), (1.0,)) for curve in (one, two)]
        force = alone + 0.5 * (parts[0].wrench(hand).force - alone) - 2.0 * (parts[1].wrench(hand).force - alone)
        np.testing.assert_allclose(both.wrench(hand).force, force, atol=1e-12)
        base = RIVER.flow(t, p)
        flow = base + 0.5 * (parts[0].flow(t, p) - base) - 2.0 * (parts[1].flow(t, p) - base)
        np.testing.assert_allclose(both.flow(t, p), flow, atol=1e-12)
    none = Edited(RIVER, (one, two), (0.0, 0.0))
    np.testing.assert_array_equal(none.flow(1.0, CIRCLE.point(0.3)), RIVER.flow(1.0, CIRCLE.point(0.3)))


def test_recording_is_not_felt_after_its_end_or_far_away():
    performed = performance(TIMES, _pushed(np.random.default_rng(4), 2.0)[0])
    edited = Edited(RIVER, (performed,), (1.0,), epsilon=0.01)
    for p, t in ((CIRCLE.point(0.2), 4.5), (performed.point(1.5) + np.array([0.0, 0.0, 0.011]), 1.5)):
        hand = HandState.at(p, t=t)
        np.testing.assert_array_equal(edited.wrench(hand).force, RIVER.wrench(hand).force)
        np.testing.assert_array_equal(edited.flow(t, p), RIVER.flow(t, p))


def test_waiting_recording_resumes_when_the_hand_arrives_and_repeats():
    performed = performance(TIMES, _pushed(np.random.default_rng(5), 2.0)[0])
    program = Edited(RIVER, (performed,), (1.0,), pace="wait").program()
    slot = program.places()[1].memory  # the recording comes second
    clock = np.arange(9000) * 1e-3
    held = np.array([HandState.at([0.0, 0.0, 0.06], t=t).vector() for t in clock[:100]])
    along = np.array([HandState.at(performed.point(t % 4.0), t=0.1 + t).vector() for t in clock])
    memory, phases = program.fresh_memory(), []
    for hand in np.concatenate((held, along)):
        run_over(*program.compiled(), memory, hand[None], np.empty((1, 6)))
        phases.append(memory[slot + 1])
    assert phases[99] == 0.0
    np.testing.assert_allclose(phases[100:4000], clock[:3900], atol=2e-3)
    np.testing.assert_allclose(phases[-1], clock[-1] % 4.0, atol=0.02)


def test_field_is_continuous_in_space():
    performed = performance(TIMES, _pushed(np.random.default_rng(6), 2.0)[0])
    rng = np.random.default_rng(7)
    program = Edited(River(CIRCLE, 0.03, 0.02), (performed,), (1.0,), epsilon=0.02).program()
    for t in rng.uniform(0.5, 3.5, 6):
        direction = np.cross(rng.normal(size=3), CIRCLE.point(t))
        direction *= 0.035 / np.linalg.norm(direction)
        centre = performed.point(t)
        assert largest_jump(program, centre - direction, centre + direction, [0.1, 0, 0], t) < 1e-9


PERFORMED = performance(TIMES, _pushed(np.random.default_rng(8), 2.0)[0])
FIELDS = [Edited(RIVER, (PERFORMED,), (1.0,), pace=pace) for pace in ("clock", "wait")]


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-1e9, 1e9)] * 3), st.tuples(*[st.floats(-1e3, 1e3)] * 3), st.floats(0, 1e6))
def test_force_and_flow_are_finite_everywhere(p, v, t):
    for field in FIELDS:
        assert np.isfinite(field.wrench(HandState.at(p, v, t)).force).all()
        assert np.isfinite(field.flow(t, np.array(p))).all()


def test_invalid_arguments_raise_parameter_error():
    with pytest.raises(ParameterError, match="1 performances need as many"):
        Edited(RIVER, (PERFORMED,), (1.0, 2.0))
    with pytest.raises(ParameterError, match="finite weights"):
        Edited(RIVER, (PERFORMED,), (np.nan,))
    with pytest.raises(ParameterError, match="epsilon"):
        Edited(RIVER, (PERFORMED,), (1.0,), 0.0)
