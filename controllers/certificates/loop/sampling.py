"""Sampling of a servo: period, delay and velocity filter."""

import math
from dataclasses import dataclass

from controllers.errors import ParameterError

# Largest delay: each period adds three states to the loop, and the time for its eigenvalues grows cubically.
MAX_DELAY_PERIODS = 128


@dataclass(frozen=True)
class Sampling:
    """Sampling period, delay and velocity filter of the servo.

    Parameters
    ----------
    period : float
        T [s].
    delay : float
        Time from a sample to its torque [s]; need not be a multiple of T.
    cutoff : float
        Corner frequency of the velocity filter [Hz].

    Raises
    ------
    ParameterError
        If the period or the cutoff is not positive, if the delay is negative or longer than 128 periods, or if one of
        them is not finite.
    """

    period: float
    delay: float = 0.0
    cutoff: float = 150.0

    def __post_init__(self) -> None:
        values = (self.period, self.delay, self.cutoff)
        if not all(math.isfinite(value) for value in values) or self.period <= 0.0 or self.cutoff <= 0.0:
            raise ParameterError(f"period and cutoff of a loop must be positive and finite, got {self}")
        if self.delay < 0.0:
            raise ParameterError(f"the delay of a loop must be at least 0 s, got {self.delay}")
        if self.delay > MAX_DELAY_PERIODS * self.period:
            limit = f"{MAX_DELAY_PERIODS} periods of {self.period:g} s"
            raise ParameterError(f"the delay of a loop must be at most {limit}, got {self.delay} s")

    @property
    def keep(self) -> float:
        """Fraction s of the previous rate that the velocity filter keeps: e^{−2π f T}."""
        return math.exp(-2.0 * math.pi * self.cutoff * self.period)

    @property
    def whole_delay(self) -> int:
        """Whole periods in the delay."""
        return int(self.delay / self.period + 1e-9)

    @property
    def rest_delay(self) -> float:
        """Delay beyond whole periods [s], in [0, T)."""
        rest = self.delay - self.whole_delay * self.period
        return rest if rest > 1e-9 * self.period else 0.0
