"""Low-pass filter of captures over the closed lap."""

import numpy as np
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.motion.captures import Capture, low_pass
from controllers.motion.channels import closing_signs

N, DURATION = 256, 1.25


def waves(frequency: float, size: float) -> np.ndarray:
    """A lap of a root that moves vertically and turns, both at one frequency [Hz]."""
    t = DURATION * np.arange(N) / N
    wave = size * np.sin(2.0 * np.pi * frequency * t)
    quaternions = Rotation.from_rotvec(np.outer(wave, [0.0, 1.0, 0.0])).as_quat(scalar_first=True)
    return np.concatenate([np.outer(wave, [0.0, 0.0, 1.0]), quaternions], axis=1)


@pytest.mark.parametrize("cycles", [1, 4, 8, 16, 32])
def test_each_frequency_is_attenuated_by_the_filter_response(cycles: int) -> None:
    frequency, cutoff = cycles / DURATION, 5.0
    size = 0.01
    passed = low_pass(waves(frequency, size), DURATION, cutoff)
    share = 1.0 / (1.0 + (frequency / cutoff) ** 4)
    np.testing.assert_allclose(passed[:, 2], share * waves(frequency, size)[:, 2], atol=1e-12)
    bent = Rotation.from_quat(passed[:, 3:], scalar_first=True).as_rotvec()[:, 1]
    np.testing.assert_allclose(bent, share * waves(frequency, size)[:, 2], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(passed[:, 3:], axis=1), 1.0, atol=1e-15)


def test_low_pass_matches_a_zero_phase_butterworth_filter() -> None:
    rng = np.random.default_rng(1)
    lap = waves(0.8, 0.1)
    lap[:, 2] += 0.02 * rng.normal(size=N)
    laps = np.tile(lap[:, 2], 9)
    sections = signal.butter(2, 5.0, fs=N / DURATION, output="sos")
    twice = signal.sosfiltfilt(sections, laps)[4 * N : 5 * N]
    np.testing.assert_allclose(low_pass(lap, DURATION, 5.0)[:, 2], twice, atol=2e-4)


def test_rotation_that_returns_as_its_negative_is_continuous() -> None:
    angle = 2.0 * np.pi * np.arange(N) / N
    turning = Rotation.from_rotvec(np.outer(angle, [0.0, 0.0, 1.0])).as_quat(scalar_first=True)
    # Followed continuously, one turn ends at −q.
    turning[turning[:, 3] < 0.0] *= -1.0
    lap = np.concatenate([np.zeros((N, 3)), turning], axis=1)
    assert closing_signs(lap, 1).tolist() == [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0]
    passed = Rotation.from_quat(low_pass(lap, DURATION, 5.0)[:, 3:], scalar_first=True)
    difference = passed * Rotation.from_quat(turning, scalar_first=True).inv()
    assert difference.magnitude().max() < 1e-6


@pytest.mark.parametrize("numbers", [(0.0, 5.0, 0.75), (0.02, np.nan, 0.75), (0.02, 5.0, -1.0)])
def test_invalid_capture_parameters_raise_parameter_error(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ParameterError, match="all positive"):
        Capture(*numbers)
