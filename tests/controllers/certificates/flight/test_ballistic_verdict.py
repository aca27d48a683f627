"""Verdicts on motions whose flights are known."""

import numpy as np
import pytest
from scipy.optimize import linprog

from controllers.certificates.flight.ballistic import BodyMotion, ballistic_verdict, judge_flights
from controllers.certificates.flight.rate_bounds import floor_rates, rate_bounds, turns_verdict
from controllers.certificates.flight.tolerance import BallisticTolerance
from controllers.errors import ParameterError

FPS = 120.0


def jump(gravity, clearance=0.3, seconds=0.5, angular=None):
    """Stand, fly for a while, stand."""
    n, fly = 180, round(seconds * FPS)
    t = np.clip(np.arange(n) - 60, 0, fly) / FPS
    com = np.column_stack([np.zeros((n, 2)), 0.9 + gravity / 2 * t * (seconds - t)])
    supported = np.ones(n, dtype=bool)
    supported[61 : 60 + fly] = False
    angular = np.tile([0.0, -5.0, 0.0], (n, 1)) if angular is None else angular
    low = np.where(supported, 0.0, clearance)
    return BodyMotion(FPS, com, angular, np.tile(10.0 * np.eye(3), (n, 1, 1)), low, supported)


def verdict(motion, tolerance=None):
    tolerance = tolerance or BallisticTolerance()
    return ballistic_verdict(motion, judge_flights(motion, tolerance), tolerance)


@pytest.mark.parametrize("gravity", [9.2, 9.81, 11.9])
def test_what_falls_naturally_is_certified(gravity):
    found = verdict(jump(gravity))
    assert found.verdict == "certified"
    assert found.margin > 0.0


@pytest.mark.parametrize("gravity", [4.0, 8.5, 13.5, 66.0])
def test_what_does_not_is_refuted_with_a_take_off_that_shows_it(gravity):
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
    ("gravity", "said"), [(-0.5, "such as a box"), (0.4, "such as a box"), (2.0, "at 2.21 of its")]
)
def test_what_hardly_falls_is_said_to_be_borne_and_not_to_be_played_faster(gravity, said):
    (flight,) = judge_flights(jump(gravity), BallisticTolerance())
    assert flight.verdict == "refuted"
    assert said in flight.reason


def test_the_admissible_rates_are_those_at_which_it_would_be_certified():
    (flight,) = judge_flights(jump(11.0), BallisticTolerance())
    for rate, expected in (
        (1.03 * flight.seen[0], "certified"), (0.97 * flight.seen[1], "certified"),
        (0.94 * flight.seen[0], "refuted"), (1.06 * flight.seen[1], "refuted"),
    ):  # fmt: skip
        motion = jump(11.0)
        played = BodyMotion(
            rate * FPS, motion.com, rate * motion.angular, motion.inertia, motion.clearance, motion.supported
        )
        assert verdict(played).verdict == expected


def test_a_body_that_hovers_low_is_doubtful():
    assert verdict(jump(2.0, clearance=0.05)).verdict == "unknown"
    assert verdict(jump(2.0, clearance=0.15)).verdict == "refuted"


def test_no_floor_pulls_so_falling_too_fast_is_refuted_however_low():
    assert verdict(jump(40.0, clearance=0.05)).verdict == "refuted"


def test_angular_momentum_must_stay():
    excess = np.where(np.arange(180) < 90, 60.0, -60.0)
    angular = np.column_stack([excess, np.zeros(180), np.zeros(180)])
    found = verdict(jump(9.81, angular=angular))
    assert found.verdict == "refuted"
    assert "angular momentum" in found.reason


def test_without_flight_there_is_nothing_to_refute():
    motion = jump(9.81)
    still = BodyMotion(FPS, motion.com, motion.angular, motion.inertia, motion.clearance, np.ones(180, dtype=bool))
    assert verdict(still).verdict == "certified"


@pytest.mark.parametrize("arguments", [{"gravity": (10.0, 12.0)}, {"distance": 0.0}, {"drift": float("nan")}])
def test_tolerances_are_checked(arguments):
    with pytest.raises(ParameterError):
        BallisticTolerance(**arguments)


def test_motions_are_checked():
    motion = jump(9.81)
    with pytest.raises(ParameterError, match="com"):
        BodyMotion(FPS, motion.com[:-1], motion.angular, motion.inertia, motion.clearance, motion.supported)


def circling(speed, radius, n=600):
    angle = speed / radius * np.arange(n) / FPS
    com = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, 0.9)])
    inertia = np.tile(np.eye(3), (n, 1, 1))
    return BodyMotion(FPS, com, np.zeros((n, 3)), inertia, np.zeros(n), np.ones(n, dtype=bool))


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
def test_a_turn_may_be_run_as_fast_as_friction_holds(speed):
    motion = circling(speed, radius=2.0)
    fastest = np.sqrt(0.8 * 9.81 * 2.0)
    assert floor_rates(motion, 0.8) == pytest.approx(np.full(600, fastest / speed), rel=0.01)
    expected = "certified" if speed < fastest else "refuted"
    assert turns_verdict(motion, (), 0.8, 600).verdict == expected


def test_no_body_on_the_floor_comes_nearer_to_a_turn_than_the_verdict_says():
    motion, friction = circling(4.6, radius=2.0), 0.8
    example = turns_verdict(motion, (), friction, 600).counterexample
    window = motion.com[example["start"] : example["end"] + 1]
    inwards = np.asarray(example["acceleration"])[:2] / np.linalg.norm(example["acceleration"][:2])
    across = np.append(inwards, -friction) / np.hypot(1.0, friction)  # normal of the cone where it is nearest
    # The best of all bodies along that normal, by linear programming: place, velocity, and a push in each interval.
    n, steps = len(window), 4 * (len(window) - 1)
    dt = 1.0 / FPS / 4.0
    velocity = np.tril(np.ones((steps + 1, steps)), -1) * dt
    position = np.cumsum(np.vstack([np.zeros(steps), 0.5 * (velocity[:-1] + velocity[1:]) * dt]), axis=0)[::4]
    t = np.arange(n)[:, None] / FPS
    error = np.hstack([np.ones((n, 1)), t, position])  # of place, speed and acceleration along the normal
    most = friction * 9.81 / np.hypot(1.0, friction)  # what the cone lets through along it
    wanted, one = window @ across, np.ones((n, 1))
    best = linprog(
        np.r_[np.zeros(2 + steps), 1.0],
        np.vstack([np.hstack([error, -one]), np.hstack([-error, -one])]), np.r_[wanted, -wanted],
        bounds=[(None, None)] * 2 + [(None, most)] * steps + [(0.0, None)],
    )  # fmt: skip
    assert best.success
    assert example["distance"] <= best.fun <= 1.5 * example["distance"]
    assert example["distance"] > 3e-4


def test_flights_bound_the_rate_from_both_sides_and_stance_from_above():
    motion = jump(9.81)
    flights = judge_flights(motion, BallisticTolerance())
    bounds = rate_bounds(motion, flights, 0.9)
    air = slice(flights[0].fit.start, flights[0].fit.end + 1)
    assert np.all(bounds.low[air] == flights[0].admissible[0])
    assert np.all(bounds.high[air] == flights[0].admissible[1])
    assert np.all(np.delete(bounds.low, np.r_[air]) == 0.0)
    assert flights[0].seen == pytest.approx((np.sqrt(9.0 / 9.81), np.sqrt(12.7 / 9.81)), rel=1e-6)


def test_the_stylus_gets_the_narrower_bound_of_neighbouring_frames():
    motion = jump(9.81)
    bounds = rate_bounds(motion, judge_flights(motion, BallisticTolerance()), 0.9)
    phases = np.array([0.0, 60.0, 59.5, 80.0, 90.0]) / 179
    low, high = bounds.stylus_speed(phases, np.array([0.1, 0.1, 0.1, 0.2, 0.0]))
    assert low == pytest.approx([0.0, 0.1 * bounds.low[60], 0.1 * bounds.low[60], 0.2 * bounds.low[80], 0.0])
    assert high[3] == pytest.approx(0.2 * bounds.high[80])
    assert high[4] == 0.0
    with pytest.raises(ParameterError):
        bounds.stylus_speed(np.array([1.2]), np.array([0.1]))


def test_a_turn_that_is_missed_by_little_is_not_said_to_be_reached():
    """Rounded to two decimals its rate would be 1.00, and the distance 0.0 mm."""
    motion = circling(3.0, radius=2.0)
    within = turns_verdict(motion, (), 3.0**2 / (9.81 * 2.0), 600)
    friction = 3.0**2 / (9.81 * 2.0) * 0.998 / (within.margin + 1.0)
    found = turns_verdict(motion, (), friction, 600)
    assert found.verdict == "refuted"
    assert "up to 0.999 of its speed" in found.reason
    assert float(found.reason.split("within ")[1].removesuffix(" mm")) > 0.0
