"""The governor: no force inside the speed interval, outside it a continuous one along the curve and near it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.follow import Follow
from controllers.fields.governor import Governor
from controllers.state import HandState
from tests.controllers.fields.field_probes import force_of, largest_jump, run_over

CIRCLE = Trajectory.circle(0.05, 4.0)
SPEEDS = np.array([[0.0, 0.3], [0.0, 0.3], [0.06, 0.12], [0.06, 0.12], [0.0, 0.3]])
FLIGHT = 2.5  # [s] of the lap, in the middle of the third interval
GOVERNOR = Governor(CIRCLE, SPEEDS, drag=8.0, epsilon=0.02)


def on_curve(phase, speed):
    """A hand on the circle that moves along it."""
    along = CIRCLE.velocity(phase)
    return HandState.at(CIRCLE.point(phase), speed * along / np.linalg.norm(along))


@pytest.mark.parametrize(
    ("speed", "force"), [(0.0, 0.48), (0.05, 0.08), (0.06, 0.0), (0.09, 0.0), (0.12, 0.0), (0.2, -0.64), (-0.05, 0.88)]
)
def test_slow_hand_is_pulled_forward_and_fast_hand_held_back_in_flight(speed, force):
    felt = GOVERNOR.wrench(on_curve(FLIGHT, speed))
    along = CIRCLE.velocity(FLIGHT) / np.linalg.norm(CIRCLE.velocity(FLIGHT))
    np.testing.assert_allclose(felt.force, force * along, atol=1e-12)
    assert not felt.torque.any()


@settings(max_examples=60)
@given(st.floats(0.0, 4.0), st.floats(-0.3, 0.5), st.floats(0.0, 0.03))
def test_force_matches_formula_with_interpolated_interval(phase, speed, off):
    outward = CIRCLE.point(phase) / 0.05
    hand = on_curve(phase, speed)
    felt = GOVERNOR.wrench(HandState.at(hand.p + off * outward, hand.v)).force
    least, greatest = (np.interp(phase % 4.0, np.linspace(0.0, 4.0, 5), column) for column in SPEEDS.T)
    window = max(0.0, 1.0 - (off / 0.02) ** 2) ** 3
    force = 8.0 * window * (max(0.0, least - speed) - max(0.0, speed - greatest))
    along = CIRCLE.velocity(phase) / np.linalg.norm(CIRCLE.velocity(phase))
    np.testing.assert_allclose(felt, force * along, atol=1e-6)


def test_force_is_continuous_in_position_and_speed():
    program = GOVERNOR.program()
    start, end = CIRCLE.point(2.1), CIRCLE.point(2.5)
    slow = 0.01 * CIRCLE.velocity(2.3) / np.linalg.norm(CIRCLE.velocity(2.3))
    assert largest_jump(program, 1.3 * start, 0.7 * end, slow) < 1e-6
    assert np.linalg.norm(force_of(program, HandState.at(0.5 * (start + end), slow))) > 0.0
    forces = [GOVERNOR.wrench(on_curve(FLIGHT, speed)).force for speed in np.linspace(-0.1, 0.4, 2001)]
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() <= 8.0 * 0.00025 * (1.0 + 1e-9)


def test_power_is_at_most_that_at_half_the_least_speed():
    powers = [
        GOVERNOR.wrench(hand).force @ hand.v for hand in (on_curve(FLIGHT, s) for s in np.linspace(-0.2, 0.3, 501))
    ]
    assert max(powers) == pytest.approx(0.25 * 8.0 * 0.06**2, rel=1e-3)


def test_sum_with_follow_equals_compiled_program():
    follow = Follow(CIRCLE, 300.0, 4.0, 0.02)
    both = follow.program() + GOVERNOR.program()
    rng = np.random.default_rng(3)
    hands = [HandState.at(CIRCLE.point(t) + rng.normal(scale=3e-3, size=3), rng.normal(scale=0.1, size=3))
             for t in rng.uniform(0.0, 4.0, 40)]  # fmt: skip
    wrenches, memory = np.empty((len(hands), 6)), both.fresh_memory()
    run_over(*both.compiled(), memory, np.array([hand.vector() for hand in hands]), wrenches)
    for hand, wrench in zip(hands, wrenches, strict=True):
        np.testing.assert_allclose(wrench[:3], follow.wrench(hand).force + GOVERNOR.wrench(hand).force, atol=1e-9)


def test_no_force_where_the_curve_rests():
    line = Trajectory([0.0, 1.0], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], ends="clamped")
    governor = Governor(line, [[0.05, 0.1], [0.05, 0.1]])
    assert not governor.wrench(HandState.at([-0.01, 0.0, 0.0], [0.3, 0.0, 0.0])).force.any()
    assert governor.wrench(HandState.at([0.05, 0.0, 0.0])).force[0] == pytest.approx(0.4)


def test_nan_velocity_gives_non_finite_force():
    assert not np.isfinite(GOVERNOR.wrench(HandState.at([0.0475, 0.0, 0.0], [np.nan, 0.0, 0.0])).force).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"speeds": [[0.1, 0.2]]}, r"speeds of a governor .* shape is \(1, 2\)"),
        ({"speeds": [[0.0, np.inf], [0.0, 1.0]]}, "finite"),
        ({"speeds": [[0.0, 1.0], [0.2, 0.1]]}, "row 1"),
        ({"drag": -1.0}, "drag"),
        ({"epsilon": 0.0}, "epsilon"),
    ],
)
def test_invalid_governor_raises_parameter_error(arguments, message):
    with pytest.raises(ParameterError, match=message):
        Governor(**({"curve": CIRCLE, "speeds": SPEEDS} | arguments))
