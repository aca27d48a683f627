r"""Captures that are led: noise above the frequencies of a gait is filtered out, and far leaps become steps.

A millimetre of noise is 1 m/s² at 5 Hz, and 25 m/s² at 25 Hz: more than the floor can give. So the channels of a lap
go through a Butterworth filter of second order, forwards and backwards, as is the custom for captured gaits (Winter
2009, *Biomechanics and Motor Control of Human Movement*, section 3.4),

.. math:: H(f) = \frac{1}{1 + (f/f_c)^4} ,

round the lap, so that its seam is not an end. A led figure goes at paces of its own, at which no captured flight lasts
as long as gravity lets it: what flies in a capture steps when it is led.
"""

from dataclasses import dataclass

import numpy as np

from controllers.errors import ParameterError
from controllers.state import Array


@dataclass(frozen=True)
class Capture:
    """What is made of a captured clip that is led.

    Parameters
    ----------
    radius : float
        How high over the floor the points of a limb are that stand on it [m].
    cutoff : float
        f_c [Hz].
    step : float
        Longest way from foot to foot of a gait that flies in the capture, and steps when it is led [m].

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
    """−1 for the numbers of a quaternion that comes back with the opposite sign after a lap, 1 for all others.

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
    """Channels of a lap (n, 3 + 4 k), position and k quaternions, without what is above the cutoff.

    Parameters
    ----------
    channels : Array, shape (n, 3 + 4 k)
        At equal steps of the lap.
    duration : float
        Of the lap [s].
    cutoff : float
        f_c [Hz], at which amplitudes are halved.
    """
    n, numbers = channels.shape
    signs = lap_signs(channels, (numbers - 3) // 4)
    # Twice round: a quaternion may come back with the opposite sign.
    spectrum = np.fft.rfft(np.concatenate([channels, signs * channels]), axis=0)
    frequency = np.arange(len(spectrum)) / (2.0 * duration)
    spectrum /= (1.0 + (frequency / cutoff) ** 4)[:, None]
    result = np.fft.irfft(spectrum, 2 * n, axis=0)[:n]
    rotations = result[:, 3:].reshape(n, -1, 4)
    rotations /= np.linalg.norm(rotations, axis=2, keepdims=True)
    return result
