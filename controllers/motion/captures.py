r"""Motion captures of gaits that are led: low-pass filter against noise, and parameters of their footsteps.

A millimetre of noise is 1 m/s² at 5 Hz, and 25 m/s² at 25 Hz: more than ground reaction forces can provide. So the
channels of a lap are filtered by a Butterworth filter of second order, forwards and backwards (zero phase), as is
usual for captured gaits (Winter 2009, *Biomechanics and Motor Control of Human Movement*, section 3.4),

.. math:: H(f) = \frac{1}{1 + (f/f_c)^4} ,

periodically over the lap, so that nothing special happens at its seam. A led figure moves at varying paces, at which
the flight phases of a capture would not last as long as gravity requires: they are replaced by steps.
"""

from dataclasses import dataclass

import numpy as np

from controllers.errors import ParameterError
from controllers.motion.channels import closing_signs, normalise
from geometry.arrays import Array


@dataclass(frozen=True)
class Capture:
    """Parameters of the clean-up of a motion capture that is led.

    Parameters
    ----------
    radius : float
        Height over the floor of a limb's sole points in stance [m].
    cutoff : float
        f_c [Hz].
    step : float
        Longest step of a gait that has flight phases in the capture and is led without them [m].

    Raises
    ------
    ParameterError
        If a number is not positive and finite.
    """

    radius: float
    cutoff: float = 5.0
    step: float = 0.75

    def __post_init__(self) -> None:
        numbers = np.array([self.radius, self.cutoff, self.step])
        if not (np.isfinite(numbers).all() and (numbers > 0.0).all()):
            raise ParameterError(
                f"a capture has a radius, cutoff and step, all positive; got {self.radius} m, {self.cutoff} Hz and "
                f"{self.step} m"
            )


def low_pass(channels: Array, duration: float, cutoff: float) -> Array:
    """Low-passed channels of a lap (n, 3 + 4 k): position and k quaternions.

    Parameters
    ----------
    channels : Array, shape (n, 3 + 4 k)
        Channels at equal steps of the lap.
    duration : float
        Duration of the lap [s].
    cutoff : float
        f_c [Hz], at which amplitudes are halved.
    """
    n, count = len(channels), (channels.shape[1] - 3) // 4
    signs = closing_signs(channels, count)
    # Over two laps, since a quaternion may return with the opposite sign.
    spectrum = np.fft.rfft(np.concatenate([channels, signs * channels]), axis=0)
    frequency = np.arange(len(spectrum)) / (2.0 * duration)
    spectrum /= (1.0 + (frequency / cutoff) ** 4)[:, None]
    result = np.fft.irfft(spectrum, 2 * n, axis=0)[:n]
    normalise(result, count)
    return result
