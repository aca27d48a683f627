r"""Power that the executed law injects into a vibrating hand, due to sampling, filter, delay and quantisation.

The ideal law injects b_d (φ̇ − v)·v ≤ b_d |φ̇|²/4 for any motion of the hand. The servo uses samples and their filtered
differences, and its output is held for a period and delayed. For a hand that vibrates at the frequency ω its response
is a complex stiffness

.. math:: G(\omega) = \frac{1 - e^{-i\omega T}}{i\omega T}\, e^{-i\omega\tau}
          \left(k_r + b_d \frac{(1 - s)(1 - e^{-i\omega T})}{T\,(1 - s e^{-i\omega T})}\right), \qquad
          E(\omega) = -\frac{\mathrm{Im}\,G(\omega)}{\omega}

with which a vibration of RMS speed V gains E(ω) V² watts on average. E is −b_d for ω → 0 and positive above a
frequency f_0. Different frequencies do not interact on average, so for a vibration with frequencies up to f (below the
Nyquist frequency)

.. math:: \bar P \le \tfrac14 b_d |\dot\varphi|^2 + V^2 \max_{\omega \le 2\pi f} E(\omega)^+ + \nu V

where ν bounds the force due to encoder quantisation: a reading error δ gives k_r δ + 2 b_d (1 − s) δ/T.
"""

from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.linear_loop import LinearLoop
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver
from geometry.arrays import Array

BANDS = (30.0, 100.0, 300.0)  # [Hz] upper ends: hand motion and tremor; a tool on a table; what the skin feels


class Injection(NamedTuple):
    """Excess of the executed law's power over the ideal bound.

    Attributes
    ----------
    passive_below : float
        f_0 [Hz]: slower vibrations gain no energy.
    activity : tuple of float
        max E⁺ [N s/m] up to each of `BANDS`.
    rounding : float
        ν [N].
    """

    passive_below: float
    activity: tuple[float, ...]
    rounding: float


def activity(k: float, b: float, sampling: Sampling, frequency: Array) -> Array:
    """E(ω) [N s/m] at frequencies [Hz] above 0 and up to the Nyquist frequency."""
    period, keep, omega = sampling.period, sampling.keep, 2.0 * np.pi * frequency
    unit_delay = np.exp(-1j * omega * period)
    hold = (1.0 - unit_delay) / (1j * omega * period) * np.exp(-1j * omega * sampling.delay)
    stiffness = hold * (k + b * (1.0 - keep) * (1.0 - unit_delay) / (period * (1.0 - keep * unit_delay)))
    return -stiffness.imag / omega


def injection(river: CertifiedRiver, linear: LinearLoop) -> Injection:
    """Effect of sampling, filter, delay and quantisation, for springs across the curve and dampers in any direction."""
    nyquist = 0.5 / river.sampling.period
    frequency = np.geomspace(0.1, nyquist, 2000)
    # Along the curve there is no spring.
    envelope = np.maximum(*(activity(k, river.b_d, river.sampling, frequency) for k in (0.0, river.k_r)))
    active = np.flatnonzero(envelope > 0.0)
    error = 0.5 * np.linalg.norm(linear.jacobian, axis=1) @ np.array(river.device.encoder_step)
    keep, period = river.sampling.keep, river.sampling.period
    rounding = float(error.max()) * (river.k_r + 2.0 * river.b_d * (1.0 - keep) / period)
    band_activity = tuple(max(0.0, float(envelope[frequency <= band].max())) for band in BANDS)
    return Injection(float(frequency[active[0]]) if len(active) else nyquist, band_activity, rounding)
