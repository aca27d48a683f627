r"""Oscillation detector: counts reversals of the force's high-frequency part, and lowers a gain until they stop.

.. math:: F_h = F - F_l, \quad \dot F_l = \omega_c (F - F_l), \qquad \dot n = -n/\tau + \sum_k \delta(t - t_k)

t_k are the times at which F_h exceeds a threshold and points against its direction at the previous such time. A limit
cycle of f Hz raises n to 2 f τ; a step or a wall raises it to 1 or 2, tremor (8–12 Hz) and voluntary motion (below
10 Hz) to at most 2.4. While n is above its limit the force is multiplied by a falling gain, g' = −g/τ_d, which
recovers slowly. F is the force that the hand gets, so the gain settles where the oscillation stops: a loop that is too
stiff ends up at its stability limit, a noisy one at a very small gain. Oscillation that persists nevertheless is a
fault.

The index of Dimeas & Aspragathos, "Online stability in human-robot cooperation with admittance control", IEEE Trans.
Haptics 9(2), 2016, compares the high-frequency part of the force's spectrum with the whole, and lowers gains
accordingly. Counting reversals needs no window and no transform.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from controllers.checks import check_positive
from geometry.arrays import Array, Mask

_PERIOD, _LOW_PASS, _THRESHOLD, _COUNT_DECAY, _MAX_COUNT, _GAIN_FALL, _GAIN_RISE, _TIME_DECAY, _MAX_TIME = range(9)
OSCILLATION_LAST, OSCILLATION_COUNT, OSCILLATION_GAIN, OSCILLATION_TIME, OSCILLATION_SIZE = 3, 6, 7, 8, 9


@njit
def oscillation_gain(params: Array, memory: Array, force: Array) -> float:
    """Update the detector with the force demanded at this tick; returns the gain for it.

    Parameters
    ----------
    params : Array
        `OscillationDetector.params`.
    memory : Array
        [slow part (3), fast part at the last reversal (3), n, g, time of oscillation [s]], written.
    force : Array
        [N], shape (3,).

    Returns
    -------
    float
        g in 0…1; minus the norm of the fast part [N], a negative value, if the gain has not stopped the oscillation.
    """
    dot, size, gain = 0.0, 0.0, memory[OSCILLATION_GAIN]
    for i in range(3):
        memory[i] += params[_LOW_PASS] * (gain * force[i] - memory[i])
        fast = gain * force[i] - memory[i]
        size += fast * fast
        dot += fast * memory[OSCILLATION_LAST + i]
    memory[OSCILLATION_COUNT] *= params[_COUNT_DECAY]
    x, y, z = memory[OSCILLATION_LAST], memory[OSCILLATION_LAST + 1], memory[OSCILLATION_LAST + 2]
    last = x**2 + y**2 + z**2
    if size > params[_THRESHOLD] ** 2:
        if dot < 0.0:
            memory[OSCILLATION_COUNT] += 1.0
        if dot < 0.0 or last == 0.0:
            for i in range(3):
                memory[OSCILLATION_LAST + i] = gain * force[i] - memory[i]
    oscillates = memory[OSCILLATION_COUNT] > params[_MAX_COUNT]
    gain = gain * params[_GAIN_FALL] if oscillates else min(1.0, gain + params[_GAIN_RISE])
    memory[OSCILLATION_GAIN] = gain
    memory[OSCILLATION_TIME] = memory[OSCILLATION_TIME] * params[_TIME_DECAY] + (params[_PERIOD] if oscillates else 0.0)
    return -np.sqrt(size) if memory[OSCILLATION_TIME] > params[_MAX_TIME] else gain


@dataclass(frozen=True)
class OscillationDetector:
    """Thresholds and time constants of the oscillation detector.

    Parameters
    ----------
    period : float
        Servo period T [s].
    corner : float
        ω_c/2π, corner frequency of the high-pass, above voluntary motion [Hz].
    threshold : float
        Norm of the fast part above which reversals count [N]; a hand feels 0.1 N.
    memory : float
        τ, time constant of the count [s].
    turns : float
        Count n above which the loop oscillates; a frequency of ``turns / (2 memory)``: 15 Hz.
    fall, rise : float
        Time constant of the gain's fall, and time of its recovery from 0 to 1 [s].
    longest, forget : float
        Accumulated time of oscillation that is a fault, and the time constant with which it decays [s]: a fault after
        1 s of continuous oscillation, or oscillation for a fifth of the time.

    Raises
    ------
    ParameterError
        If a number is not positive and finite.
    """

    period: float
    corner: float = 15.0
    threshold: float = 0.3
    memory: float = 0.1
    turns: float = 3.0
    fall: float = 0.1
    rise: float = 2.0
    longest: float = 1.0
    forget: float = 5.0

    def __post_init__(self) -> None:
        check_positive("the oscillation detector", self)

    def params(self) -> Array:
        """Parameters of `oscillation_gain`."""
        period = self.period
        share = 1.0 - np.exp(-2.0 * np.pi * self.corner * period)
        leak, down, forget = (np.exp(-period / time) for time in (self.memory, self.fall, self.forget))
        return np.array(
            [period, share, self.threshold, leak, self.turns, down, period / self.rise, forget, self.longest]
        )

    def fresh_memory(self) -> Array:
        """Memory of a loop that has not oscillated."""
        memory = np.zeros(OSCILLATION_SIZE)
        memory[OSCILLATION_GAIN] = 1.0
        return memory


def oscillating_ticks(detector: OscillationDetector, force: Array, memory: list[float]) -> Mask:
    """Ticks of a recorded force at which the detector finds an oscillation, with the gain kept at 1; shape (n,).

    Parameters
    ----------
    detector : OscillationDetector
    force : Array, shape (n, 3)
        Force on the hand [N].
    memory : list of float
        `fresh_memory` as a list, written, so that a record can be processed in blocks.
    """
    params = detector.params()
    params[_GAIN_FALL], params[_GAIN_RISE], params[_MAX_TIME] = 1.0, 0.0, np.inf
    # In plain Python, which takes 0.1 s; compiling the kernel would take 1 s.
    given: Any = params.tolist()
    step: Any = oscillation_gain.py_func
    found = np.zeros(len(force), dtype=np.bool_)
    for k, row in enumerate(force.tolist()):
        step(given, memory, row)
        found[k] = memory[OSCILLATION_COUNT] > given[_MAX_COUNT]
    return found
