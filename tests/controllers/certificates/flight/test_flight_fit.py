"""Fits of free fall to flights, on parabolas whose gravity is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.certificates.flight.flight_fit import find_flights, fit_flight, fit_free_fall, reachable_rates
from geometry.physics import GRAVITY

FPS = 120.0


def parabola(gravity, frames=61, fps=FPS, take_off=(1.3, -0.4, 2.5)):
    t = np.arange(frames)[:, None] / fps
    return np.array([0.2, 0.1, 0.9]) + np.array(take_off) * t - np.array([0.0, 0.0, gravity / 2]) * t**2


def fit(com, angular=None, fps=FPS):
    n = len(com)
    angular = np.tile([1.0, -20.0, 0.5], (n, 1)) if angular is None else angular
    return fit_flight((0, n - 1), fps, com, angular, np.tile(np.diag([10.0, 8.0, 2.0]), (n, 1, 1)), np.full(n, 0.3))


def test_flight_spans_last_to_first_contact_frame():
    supported = np.ones(60, dtype=bool)
    supported[20:35] = False
    supported[45:47] = False  # a foot that rolls over
    assert find_flights(supported, FPS) == [(19, 35)]


def test_flight_may_reach_the_ends_of_a_clip():
    supported = np.zeros(60, dtype=bool)
    supported[25:30] = True
    assert find_flights(supported, FPS) == [(0, 25), (29, 59)]


@given(gravity=st.floats(1.0, 80.0), frames=st.integers(8, 90), fps=st.sampled_from([16.0, 30.0, 60.0, 120.0]))
def test_fit_recovers_gravity_and_take_off_velocity_of_a_parabola(gravity, frames, fps):
    found = fit(parabola(gravity, frames, fps), fps=fps)
    assert found.gravity == pytest.approx(gravity, abs=1e-6)
    assert found.misfit == pytest.approx(0.0, abs=1e-9)
    assert found.take_off == pytest.approx([1.3, -0.4, 2.5], abs=1e-6)


def test_gravity_scales_with_the_square_of_the_playback_rate():
    slow, fast = fit(parabola(GRAVITY)), fit(parabola(GRAVITY), fps=1.5 * FPS)
    assert fast.gravity == pytest.approx(1.5**2 * slow.gravity, rel=1e-9)
    assert fast.natural_rate == pytest.approx(1 / 1.5, rel=1e-9)


def test_uncertainty_covers_gravity_error_under_noise():
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(200):
        found = fit(parabola(GRAVITY, 45) + rng.normal(0.0, 0.01, (45, 3)))
        inside += abs(found.gravity - GRAVITY) < found.uncertainty
    assert 180 <= inside <= 199


def test_likely_gravity_moves_towards_g_by_at_most_the_uncertainty():
    precise, vague = fit(parabola(20.0)), fit(parabola(20.0, 9))
    assert precise.likely_gravity == pytest.approx(precise.gravity - precise.uncertainty)
    assert precise.likely_gravity > 19.0
    assert vague.uncertainty > 10.2
    assert vague.likely_gravity == GRAVITY


def test_take_off_speed_equals_fall_speed_from_the_apex():
    found = fit(parabola(GRAVITY, 61))
    assert found.take_off_speed == pytest.approx(2.5, abs=2e-3)


def test_changing_angular_momentum_appears_as_drift():
    n = 62
    excess = np.where(np.arange(n) < n // 2, 4.0, -4.0)
    angular = np.column_stack([np.zeros(n), -20.0 + excess, np.zeros(n)])
    found = fit(parabola(GRAVITY, n), angular)
    # About y the body deviates at 4/8 rad/s for half the flight, half of that on either side of the mean.
    assert found.drift == pytest.approx(0.5 * 4.0 / 8.0 * (n / 2) / FPS, rel=0.06)
    assert fit(parabola(GRAVITY, n)).drift == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("gravity", [7.0, 9.81, 12.0])
@pytest.mark.parametrize("rate", [0.8, 1.0, 1.3])
def test_best_fall_attains_the_chebyshev_distance(gravity, rate):
    # The best line under a parabola of curvature a over T misses it by |a| T² / 16.
    com = parabola(gravity)
    T = 60 / FPS / rate
    distance, (p, v) = fit_free_fall(com, FPS, rate)
    assert distance == pytest.approx(abs(gravity * rate**2 - GRAVITY) * T**2 / 16, rel=2e-2, abs=1e-6)
    t = np.arange(61)[:, None] / (FPS * rate)
    fall = p + v * t - np.array([0.0, 0.0, GRAVITY / 2]) * t**2
    assert np.linalg.norm(fall - com, axis=1).max() == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize("gravity", [9.81, 11.0])
def test_reachable_rates_match_closed_form(gravity):
    T, d = 60 / FPS, 0.05
    low, high = reachable_rates(parabola(gravity), FPS, d)
    assert low == pytest.approx(np.sqrt(GRAVITY / (gravity + 16 * d / T**2)), rel=0.01)
    assert high == pytest.approx(np.sqrt(GRAVITY / (gravity - 16 * d / T**2)), rel=0.01)


def test_short_flight_is_reachable_at_any_higher_rate():
    low, high = reachable_rates(parabola(GRAVITY, 13), FPS, 0.05)
    assert high == np.inf
    assert 0.2 < low < 0.5


def test_zigzag_is_reachable_at_no_rate():
    com = parabola(GRAVITY)
    com[::2, 0] += 0.2
    assert reachable_rates(com, FPS, 0.05) is None
