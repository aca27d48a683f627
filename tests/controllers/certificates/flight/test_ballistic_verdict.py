"""Ballistic verdicts on synthetic motions whose flights are known."""

import numpy as np
import pytest
from scipy.optimize import linprog

from controllers.certificates.flight.ballistic import BodyMotion, ballistic_verdict, judge_flights
from controllers.certificates.flight.rate_bounds import floor_rates, rate_bounds, turns_verdict
from controllers.certificates.flight.tolerance import BallisticTolerance
from controllers.errors import ParameterError

FPS = 120.0


def jump(gravity, clearance=0.3, seconds=0.5, angular=None):
    """Stance, a flight under the given gravity, stance."""
    n, flight_frames = 180, round(seconds * FPS)
    t = np.clip(np.arange(n) - 60, 0, flight_frames) / FPS
    com = np.column_stack([np.zeros((n, 2)), 0.9 + gravity / 2 * t * (seconds - t)])
    supported = np.ones(n, dtype=bool)
    supported[61 : 60 + flight_frames] = False
    angular = np.tile([0.0, -5.0, 0.0], (n, 1)) if angular is None else angular
    clearances = np.where(supported, 0.0, clearance)
    return BodyMotion(FPS, com, angular, np.tile(10.0 * np.eye(3), (n, 1, 1)), clearances, supported)


def verdict(motion, tolerance=None):
    tolerance = tolerance or BallisticTolerance()
    return ballistic_verdict(motion, judge_flights(motion, tolerance), tolerance)


@pytest.mark.parametrize("gravity", [9.2, 9.81, 11.9])
def test_free_fall_at_plausible_gravity_is_certified(gravity):
    found = verdict(jump(gravity))
    assert found.verdict == "certified"
    assert found.margin > 0.0


@pytest.mark.parametrize("gravity", [4.0, 8.5, 13.5, 66.0])
def test_implausible_gravity_is_refuted_with_the_nearest_ballistic_flight(gravity):
    motion = jump(gravity)
    found = verdict(motion)
    assert found.verdict == "refuted"
    assert found.margin < 0.0
    start, end = found.counterexample["start"], found.counterexample["end"]
    t = np.arange(end - start + 1)[:, None] / FPS
    fall = found.counterexample["position"] + found.counterexample["velocity"] * t - [0, 0, 4.905] * t**2
    distance = np.linalg.norm(fall - motion.com[start : end + 1], axis=1).max()
    assert distance == pytest.approx(found.counterexample["distance"], abs=1e-9)


@pytest.mark.parametrize(
    ("gravity", "reason"), [(-0.5, "such as a box"), (0.4, "such as a box"), (2.0, "at 2.21 of its")]
)
def test_negligible_fall_is_reported_as_supported_and_slow_fall_with_its_admissible_rate(gravity, reason):
    (flight,) = judge_flights(jump(gravity), BallisticTolerance())
    assert flight.verdict == "refuted"
    assert reason in flight.reason


def test_playback_at_admissible_rates_is_certified_and_outside_them_refuted():
    (flight,) = judge_flights(jump(11.0), BallisticTolerance())
    for rate, expected in (
        (1.03 * flight.seen[0], "certified"), (0.97 * flight.seen[1], "certified"),
        (0.94 * flight.seen[0], "refuted"), (1.06 * flight.seen[1], "refuted"),
    ):  # fmt: skip
        motion = jump(11.0)
        retimed = BodyMotion(
            rate * FPS, motion.com, rate * motion.angular, motion.inertia, motion.clearance, motion.supported
        )
        assert verdict(retimed).verdict == expected


def test_slow_fall_near_the_floor_is_unknown():
    assert verdict(jump(2.0, clearance=0.05)).verdict == "unknown"
    assert verdict(jump(2.0, clearance=0.15)).verdict == "refuted"


def test_too_fast_fall_is_refuted_at_any_clearance():
    assert verdict(jump(40.0, clearance=0.05)).verdict == "refuted"


def test_changing_angular_momentum_is_refuted():
    excess = np.where(np.arange(180) < 90, 60.0, -60.0)
    angular = np.column_stack([excess, np.zeros(180), np.zeros(180)])
    found = verdict(jump(9.81, angular=angular))
    assert found.verdict == "refuted"
    assert "angular momentum" in found.reason


def test_motion_without_flight_is_certified():
    motion = jump(9.81)
    always_supported = BodyMotion(
        FPS, motion.com, motion.angular, motion.inertia, motion.clearance, np.ones(180, dtype=bool)
    )
    assert verdict(always_supported).verdict == "certified"


@pytest.mark.parametrize("arguments", [{"gravity": (10.0, 12.0)}, {"distance": 0.0}, {"drift": float("nan")}])
def test_invalid_tolerances_raise_parameter_error(arguments):
    with pytest.raises(ParameterError):
        BallisticTolerance(**arguments)


def test_mismatched_array_lengths_raise_parameter_error():
    motion = jump(9.81)
    with pytest.raises(ParameterError, match="com"):
        BodyMotion(FPS, motion.com[:-1], motion.angular, motion.inertia, motion.clearance, motion.supported)


def circling(speed, radius, n=600):
    angle = speed / radius * np.arange(n) / FPS
    com = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, 0.9)])
    inertia = np.tile(np.eye(3), (n, 1, 1))
    return BodyMotion(FPS, com, np.zeros((n, 3)), inertia, np.zeros(n), np.ones(n, dtype=bool))


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
def test_turn_is_certified_up_to_the_speed_that_friction_allows(speed):
    motion = circling(speed, radius=2.0)
    fastest = np.sqrt(0.8 * 9.81 * 2.0)
    assert floor_rates(motion, 0.8) == pytest.approx(np.full(600, fastest / speed), rel=0.01)
    expected = "certified" if speed < fastest else "refuted"
    assert turns_verdict(motion, (), 0.8, 600).verdict == expected


def test_turn_counterexample_distance_matches_linear_program():
    motion, friction = circling(4.6, radius=2.0), 0.8
    example = turns_verdict(motion, (), friction, 600).counterexample
    window = motion.com[example["start"] : example["end"] + 1]
    inwards = np.asarray(example["acceleration"])[:2] / np.linalg.norm(example["acceleration"][:2])
    normal = np.append(inwards, -friction) / np.hypot(1.0, friction)  # of the friction cone, where it is nearest
    # Least distance along that normal by linear programming over position, velocity and an acceleration per interval.
    n, steps = len(window), 4 * (len(window) - 1)
    dt = 1.0 / FPS / 4.0
    velocity = np.tril(np.ones((steps + 1, steps)), -1) * dt
    position = np.cumsum(np.vstack([np.zeros(steps), 0.5 * (velocity[:-1] + velocity[1:]) * dt]), axis=0)[::4]
    t = np.arange(n)[:, None] / FPS
    error = np.hstack([np.ones((n, 1)), t, position])  # by position, speed and acceleration along the normal
    greatest = friction * 9.81 / np.hypot(1.0, friction)  # acceleration along the normal that the cone allows
    target, ones = window @ normal, np.ones((n, 1))
    best = linprog(
        np.r_[np.zeros(2 + steps), 1.0],
        np.vstack([np.hstack([error, -ones]), np.hstack([-error, -ones])]), np.r_[target, -target],
        bounds=[(None, None)] * 2 + [(None, greatest)] * steps + [(0.0, None)],
    )  # fmt: skip
    assert best.success
    assert example["distance"] <= best.fun <= 1.5 * example["distance"]
    assert example["distance"] > 3e-4


def test_rate_is_bounded_on_both_sides_in_flight_and_from_above_in_stance():
    motion = jump(9.81)
    flights = judge_flights(motion, BallisticTolerance())
    bounds = rate_bounds(motion, flights, 0.9)
    flight_frames = slice(flights[0].fit.start, flights[0].fit.end + 1)
    assert np.all(bounds.low[flight_frames] == flights[0].admissible[0])
    assert np.all(bounds.high[flight_frames] == flights[0].admissible[1])
    assert np.all(np.delete(bounds.low, np.r_[flight_frames]) == 0.0)
    assert flights[0].seen == pytest.approx((np.sqrt(9.0 / 9.81), np.sqrt(12.7 / 9.81)), rel=1e-6)


def test_stylus_speed_uses_the_narrower_bound_of_neighbouring_frames():
    motion = jump(9.81)
    bounds = rate_bounds(motion, judge_flights(motion, BallisticTolerance()), 0.9)
    phases = np.array([0.0, 60.0, 59.5, 80.0, 90.0]) / 179
    low, high = bounds.stylus_speed(phases, np.array([0.1, 0.1, 0.1, 0.2, 0.0]))
    assert low == pytest.approx([0.0, 0.1 * bounds.low[60], 0.1 * bounds.low[60], 0.2 * bounds.low[80], 0.0])
    assert high[3] == pytest.approx(0.2 * bounds.high[80])
    assert high[4] == 0.0
    with pytest.raises(ParameterError):
        bounds.stylus_speed(np.array([1.2]), np.array([0.1]))


def test_narrowly_missed_turn_is_not_rounded_to_a_reached_one():
    """Rounded to two decimals its rate would be 1.00, and the distance 0.0 mm."""
    motion = circling(3.0, radius=2.0)
    within = turns_verdict(motion, (), 3.0**2 / (9.81 * 2.0), 600)
    friction = 3.0**2 / (9.81 * 2.0) * 0.998 / (within.margin + 1.0)
    found = turns_verdict(motion, (), friction, 600)
    assert found.verdict == "refuted"
    assert "up to 0.999 of its speed" in found.reason
    assert float(found.reason.split("within ")[1].removesuffix(" mm")) > 0.0
