"""Smoothness of movements: spectral arc length and dimensionless jerk."""

import numpy as np
import pytest
from scipy import signal

from experiments.results.measures.smoothness import (
    SPEED_RATE,
    VELOCITY_CUTOFF,
    log_dimensionless_jerk,
    spectral_arc_length,
    speed_profile,
)


def reach(seconds: float, rate: float = 100.0, length: float = 1.0) -> np.ndarray:
    """Speed of a minimum-jerk reach, ẋ = (A/T) 30 (s² − 2 s³ + s⁴)."""
    s = np.arange(0.0, seconds, 1.0 / rate) / seconds
    return length / seconds * 30.0 * (s**2 - 2.0 * s**3 + s**4)


def test_jerk_of_minimum_jerk_reach_matches_closed_form() -> None:
    # ∫ jerk² dt = 720 A²/T⁵ and the peak speed is 1.875 A/T, so LDLJ = −ln(720 / 1.875²).
    assert log_dimensionless_jerk(reach(1.0, 2000.0), 2000.0) == pytest.approx(-np.log(720.0 / 1.875**2), rel=2e-3)


@pytest.mark.parametrize("measure", [spectral_arc_length, log_dimensionless_jerk])
def test_smoothness_is_invariant_to_amplitude_and_duration(measure) -> None:
    first = measure(reach(1.0, 1000.0), 1000.0)
    assert measure(reach(1.0, 1000.0, length=0.03), 1000.0) == pytest.approx(first, abs=1e-9)
    assert measure(reach(2.0, 1000.0), 1000.0) == pytest.approx(first, abs=0.05)


def test_sparc_of_one_reach_is_published_value_and_falls_with_submovements() -> None:
    # Balasubramanian et al. 2015: about −1.4 for a single minimum-jerk movement, less with each added one.
    values = [spectral_arc_length(np.concatenate([reach(0.5)] * n), SPEED_RATE) for n in (1, 2, 4, 8)]
    assert values[0] == pytest.approx(-1.4, abs=0.1)
    assert values == sorted(values, reverse=True)


def test_tremor_lowers_both_smoothness_measures() -> None:
    t = np.arange(0.0, 2.0, 0.01)
    shaken = reach(2.0) + 0.3 * (1.0 + np.sin(2.0 * np.pi * 9.0 * t))
    for measure in (spectral_arc_length, log_dimensionless_jerk):
        assert measure(shaken, SPEED_RATE) < measure(reach(2.0), SPEED_RATE) - 0.2


def test_speed_profile_equals_zero_phase_butterworth() -> None:
    rate = 1000.0
    velocity = np.cumsum(np.random.default_rng(1).normal(size=(3000, 3)), axis=0) * 1e-3
    smooth = signal.sosfiltfilt(signal.butter(2, VELOCITY_CUTOFF, fs=rate, output="sos"), velocity, axis=0)
    expected = np.linalg.norm(smooth[:: round(rate / SPEED_RATE)], axis=1)
    assert speed_profile(velocity, rate) == pytest.approx(expected, abs=0.01 * expected.max())


def test_speed_profile_removes_encoder_noise() -> None:
    t = np.arange(0.0, 4.0, 1e-3)
    velocity = np.stack([np.cos(np.pi * t), np.sin(np.pi * t), np.zeros_like(t)], axis=1)
    noisy = velocity + np.random.default_rng(1).normal(scale=0.05, size=velocity.shape)
    speed = speed_profile(noisy, 1000.0)[20:-20]
    assert len(speed_profile(noisy, 1000.0)) == 400
    assert np.abs(speed - 1.0).max() < 0.05


def test_smoothness_of_resting_hand() -> None:
    assert np.isnan(log_dimensionless_jerk(np.zeros(100), SPEED_RATE))
    assert spectral_arc_length(np.zeros(100), SPEED_RATE) == 0.0
