"""Smoothness of a movement from its speed: spectral arc length (SPARC) and log dimensionless jerk (LDLJ)."""

import numpy as np

from geometry.arrays import Array

VELOCITY_CUTOFF = 20.0  # [Hz] of the low-pass on the velocity: above voluntary motion, below the noise of the encoders
SPEED_RATE = 100.0  # [Hz] at which the speed is sampled
_MAX_FREQUENCY, _AMPLITUDE_THRESHOLD, _PADDING_POWERS = 10.0, 0.05, 4  # [Hz], share of the largest value, powers of two
_SETTLING_PERIODS = 2.0  # periods of the cutoff after which the filter's response to an end has decayed, to some 1e-4


def speed_profile(velocity: Array, rate: float) -> Array:
    r"""Speed |v| of a velocity (n, 3) sampled at `rate` [Hz], low-passed with zero phase and resampled at `SPEED_RATE`.

    The gain :math:`1/(1 + (f/f_c)^4)` is that of a second-order Butterworth filter run forwards and backwards. Beyond
    its ends the velocity is continued by point reflection. A velocity of at most `_SETTLING_PERIODS` periods of the
    cutoff frequency is not filtered.
    """
    margin = round(_SETTLING_PERIODS / VELOCITY_CUTOFF * rate)
    smooth = velocity
    if len(velocity) > margin:
        before, after = 2.0 * velocity[0] - velocity[margin:0:-1], 2.0 * velocity[-1] - velocity[-2 : -margin - 2 : -1]
        longer = np.concatenate([before, velocity, after])
        share = 1.0 / (1.0 + (np.fft.rfftfreq(len(longer), 1.0 / rate) / VELOCITY_CUTOFF) ** 4)
        smooth = np.fft.irfft(np.fft.rfft(longer, axis=0) * share[:, None], len(longer), axis=0)[margin:-margin]
    return np.linalg.norm(smooth[:: max(1, round(rate / SPEED_RATE))], axis=1)


def spectral_arc_length(speed: Array, rate: float) -> float:
    r"""SPARC: minus the arc length of the normalised spectrum of the speed; 0 is smoothest.

    .. math:: -\int_0^{\omega_c} \sqrt{\omega_c^{-2} + \hat V'(\omega)^2}\, d\omega,
        \qquad \hat V(\omega) = V(\omega)/\max V

    up to the last frequency ω_c below 10 Hz at which V̂ reaches 0.05. S. Balasubramanian, A. Melendez-Calderon, A.
    Roby-Brami, E. Burdet, "On the analysis of movement smoothness", *J. NeuroEngineering and Rehabilitation* 12:112,
    2015, whose cutoff, threshold and zero padding these are.

    Parameters
    ----------
    speed : Array
        Speed samples, shape (n,).
    rate : float
        Sampling rate [Hz].
    """
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + _PADDING_POWERS)
    spectrum, frequency = np.abs(np.fft.rfft(speed, size)), np.fft.rfftfreq(size, 1.0 / rate)
    if spectrum.max() <= 0.0:
        return 0.0
    within = frequency <= _MAX_FREQUENCY
    spectrum, frequency = spectrum[within] / spectrum.max(), frequency[within]
    above = np.flatnonzero(spectrum >= _AMPLITUDE_THRESHOLD)
    spectrum, frequency = spectrum[above[0] : above[-1] + 1], frequency[above[0] : above[-1] + 1]
    if len(frequency) < 2:
        return 0.0
    span = frequency[-1] - frequency[0]
    return -float(np.sum(np.hypot(np.diff(frequency) / span, np.diff(spectrum))))


def log_dimensionless_jerk(speed: Array, rate: float) -> float:
    r"""LDLJ: minus the logarithm of the dimensionless integrated squared jerk; larger is smoother.

    .. math:: -\ln\left(\frac{T^3}{v_{peak}^2} \int_0^T \ddot v(t)^2\, dt\right)

    N. Hogan and D. Sternad, "Sensitivity of smoothness measures to movement duration, amplitude, and arrests",
    *J. Motor Behavior* 41, 2009, computed from the speed as in Balasubramanian et al. 2015. NaN for a hand at rest.

    Parameters
    ----------
    speed : Array
        Speed samples, shape (n,), n ≥ 3.
    rate : float
        Sampling rate [Hz].
    """
    peak = float(np.max(speed))
    jerk = np.diff(speed, 2) * rate**2
    total = float(np.sum(jerk**2)) / rate
    if peak <= 0.0 or total <= 0.0:
        return float("nan")
    return -float(np.log((len(speed) / rate) ** 3 / peak**2 * total))
