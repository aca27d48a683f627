r"""Motion captures of gaits that are led: low-pass filter against noise, and parameters of their footsteps.

A millimetre of noise is 1 m/s² at 5 Hz, and 25 m/s² at 25 Hz: more than ground reaction forces can give. So the
channels of a lap are filtered by a Butterworth filter of second order, forwards and backwards (zero phase), as is
usual for captured gaits (Winter 2009, *Biomechanics and Motor Control of Human Movement*, section 3.4),

.. math:: H(f) = \frac{1}{1 + (f/f_c)^4} ,

periodically over the lap, so that its seam is not an end. A led figure moves at varying paces, at which the flight
phases of a capture would not last as long as gravity requires: they are replaced by steps when the capture is led.
"""

from dataclasses import dataclass

import numpy as np

from controllers.errors import ParameterError
from controllers.state import Array


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


def lap_signs(rows: Array, quaternions: int) -> Array:
    """−1 for the channels of a quaternion that returns with the opposite sign after a lap, 1 for all others.

    Parameters
    ----------
    rows : Array, shape (n, 3 + 4 quaternions + …)
        Channels at equal steps of the lap: position, quaternions, others.
    quaternions : int
    """
    signs = np.ones(rows.shape[1])
    for first in range(3, 3 + 4 * quaternions, 4):
        signs[first : first + 4] = 1.0 if rows[-1, first : first + 4] @ rows[0, first : first + 4] >= 0.0 else -1.0
    return signs


def low_passed(channels: Array, duration: float, cutoff: float) -> Array:
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
    n, numbers = channels.shape
    signs = lap_signs(channels, (numbers - 3) // 4)
    # Over two laps, since a quaternion may return with the opposite sign.
    spectrum = np.fft.rfft(np.concatenate([channels, signs * channels]), axis=0)
    frequency = np.arange(len(spectrum)) / (2.0 * duration)
    spectrum /= (1.0 + (frequency / cutoff) ** 4)[:, None]
    result = np.fft.irfft(spectrum, 2 * n, axis=0)[:n]
    rotations = result[:, 3:].reshape(n, -1, 4)
    rotations /= np.linalg.norm(rotations, axis=2, keepdims=True)
    return result
