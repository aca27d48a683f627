r"""The residual wrench of a physical figure, compared with published bounds for simulations of movement.

Hicks et al. (2015, "Is my model good enough?", J. Biomech. Eng. 137, 020905, section 3.1.3) recommend residual forces
of at most 5 %, peak and RMS, of the measured net external force, and residual moments of at most 1 % of the height of
the centre of mass times that force. The net external force of a figure whose feet are on the floor is its weight W on
average and more at its peaks, so W in its place is the stricter bound: ‖f‖ ≤ 0.05 W and ‖m‖ ≤ 0.01 W h.
"""

import math
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from models.mocap.preparation.bounds import exceeding_text

MAX_FORCE_RATIO, MAX_MOMENT_RATIO = 0.05, 0.01  # bounds of Hicks et al.: shares of W, and of W h
MIN_GROUND_FORCE = 1.0  # [N] vertical ground reaction force above which the ground supports the figure


@dataclass(frozen=True)
class Residual:
    """RMS and peak of the residual over some time.

    Attributes
    ----------
    seconds : float
        Duration [s].
    force_rms, force_max, moment_rms, moment_max : float
        Force as a share of body weight, moment as a share of weight × height of the centre of mass.
    """

    seconds: float
    force_rms: float
    force_max: float
    moment_rms: float
    moment_max: float

    def brief(self) -> str:
        """RMS and peak of force and moment in percent, in words."""
        force, force_max = _percent(self.force_rms, MAX_FORCE_RATIO), _percent(self.force_max, MAX_FORCE_RATIO)
        moment, moment_max = _percent(self.moment_rms, MAX_MOMENT_RATIO), _percent(self.moment_max, MAX_MOMENT_RATIO)
        return (
            f"force {force} % and {force_max} % of weight, moment {moment} % and {moment_max} % of weight × height of "
            "the centre of mass"
        )

    def missed(self) -> tuple[str, ...]:
        """Names of the bounds of Hicks et al. that are exceeded."""
        met = {
            "RMS force": self.force_rms <= MAX_FORCE_RATIO,
            "peak force": self.force_max <= MAX_FORCE_RATIO,
            "RMS moment": self.moment_rms <= MAX_MOMENT_RATIO,
            "peak moment": self.moment_max <= MAX_MOMENT_RATIO,
        }
        return tuple(name for name, is_met in met.items() if not is_met)

    def verdict(self) -> str:
        """Which of the bounds are met, in words."""
        missed = self.missed()
        bounds = f"bounds of Hicks et al. 2015 (force {100 * MAX_FORCE_RATIO:g} %, moment {100 * MAX_MOMENT_RATIO:g} %)"
        return f"{bounds}: all met" if not missed else f"{bounds} missed by {', '.join(missed)}"


def _percent(share: float, bound: float) -> str:
    """A share in percent, with enough decimals to distinguish it from a bound that it exceeds."""
    return exceeding_text(100.0 * share, 100.0 * bound) if share > bound else f"{100.0 * share:.1f}"


class ResidualMeasure:
    """Accumulates `Residual` over blocks of wrenches sampled every `period` [s].

    `weight` is the figure's [N], `com_height` the height of its centre of mass when it stands [m].
    """

    def __init__(self, weight: float, com_height: float, period: float):
        self._scale = np.array([weight, weight * com_height])
        self._period = period
        self._squares, self._largest, self._count = np.zeros(2), np.zeros(2), 0

    def add(self, wrenches: Array) -> None:
        """Add forces [N] and moments [N m], shape (n, 6)."""
        sizes = np.linalg.norm(wrenches.reshape(-1, 2, 3), axis=2) / self._scale
        self._squares += np.sum(sizes**2, axis=0)
        self._largest = np.maximum(self._largest, sizes.max(axis=0, initial=0.0))
        self._count += len(wrenches)

    def summary(self) -> Residual:
        """The residual of all wrenches added so far; zero if there were none."""
        (force, moment), n = self._squares, max(self._count, 1)
        largest = self._largest.tolist()
        return Residual(self._count * self._period, math.sqrt(force / n), largest[0], math.sqrt(moment / n), largest[1])
