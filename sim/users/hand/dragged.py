r"""A hand dragged interactively: an arm whose intended point is updated for every block of ticks.

.. math:: F = k\,(p_d - p) + b\,(\dot p_d - v), \qquad p_d(t) = a + (b - a)\,(t - t_0)/T

It is the arm of `sim.users.hand.arm` with other numbers: in a block the intended point moves from a to b at constant
speed, as a path of two samples or, with the switch pressed, as a steady grab. So nothing new is compiled, and the force
law is the same as for every simulated hand.
"""

import numpy as np

from geometry.arrays import Array
from sim.users.hand.actions import GRAB
from sim.users.hand.arm import CompiledArm

_SAMPLE_SPACING = 1e6  # [s] between the two samples of a path, longer than any run
_ENDLESS_HOLD = 1e9  # [s] hold time of a grab
_TREMOR_WAVES = ((8.7, 0.0), (9.6, 2.1), (10.9, 4.2))  # frequency [Hz] and phase [rad] along x, y, z

TREMOR_AMPLITUDE = 1e-4
"""Amplitude of the physiological tremor of a hand at rest [m]: a tenth of a millimetre at 8 to 12 Hz."""


def relaxed(arm: CompiledArm) -> CompiledArm:
    """The arm of a hand that has released the stylus and its switch."""
    arm.switch[0] = 0.0
    return arm._replace(path=np.zeros((0, 3)), grabs=np.zeros(0, GRAB), held=np.zeros((0, 3)))


def dragged(arm: CompiledArm, t: float, seconds: float, start: Array, end: Array, pressed: bool) -> CompiledArm:
    """The arm of a hand that drags the stylus from one point to another within a block.

    Parameters
    ----------
    arm : CompiledArm
        Provides the impedance.
    t, seconds : float
        Start and duration of the block [s].
    start, end : Array
        a and b in H [m], shape (3,).
    pressed : bool
        Whether the switch is pressed.
    """
    carry = np.asarray(end, dtype=np.float64) - start
    if pressed:
        grab = np.array(
            [(t, 0.0, start, carry, seconds, _ENDLESS_HOLD, 1.0)], GRAB
        )  # at a place that is reached at once
        return arm._replace(path=np.zeros((0, 3)), grabs=grab, held=np.full((1, 3), np.nan))
    speed = carry / seconds
    first = start - speed * t
    return relaxed(arm)._replace(path=np.array([first, first + _SAMPLE_SPACING * speed]), period=_SAMPLE_SPACING)


def tremor(t: float) -> Array:
    """Physiological tremor of an outstretched hand at a time [s], in H [m], shape (3,): 8 to 12 Hz, a tenth of a mm.

    A real hand never holds still (Stiles 1976, J. Appl. Physiol. 40: 44-54), so the plausibility check of a device
    treats constant readings as a fault.
    """
    return np.array([TREMOR_AMPLITUDE * np.sin(2.0 * np.pi * rate * t + phase) for rate, phase in _TREMOR_WAVES])
