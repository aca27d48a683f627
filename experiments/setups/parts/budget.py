r"""Energy tank of a run: the power and energy that its field may inject.

The tank is dimensioned such that a normal run never empties it, while a wrong or late law does.

.. math:: P = \tfrac14 b_d |\dot\varphi|^2_{max}

is the largest power that the damper of a river injects (see `controllers.certificates.loop.energy`); for several rivers
the powers add. Initially the tank holds the energy that the springs give to a hand that begins at the edge of the map's
domain; its capacity is the energy of the springs drawn with the limiter's force, which a hand that has drawn them gets
back. For an unknown field, the limiter's force times the curve's pace bounds the power, and the limiter's force across
the workspace bounds the energy.
"""

from collections.abc import Sequence

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.safety.energy_tank import EnergyTank, spring_store
from controllers.safety.limiter import ForceLimiter

WORKSPACE_WIDTH = 0.2  # [m] by which a spring can be drawn: the width of the workspace
_MIN_BUDGET = 1e-3  # [W], [J] for a field without springs or dampers: quantised encoders falsify the measured work
_SAMPLE_COUNT = 512  # samples of a curve in the search for its greatest speed


def tank_for(power: float, springs: Sequence[tuple[float, float]], start: float, limiter: ForceLimiter) -> EnergyTank:
    """Energy tank for dampers of a given power and for springs.

    Parameters
    ----------
    power : float
        Largest power that dampers inject [W].
    springs : sequence of (float, float)
        Stiffness [N/m] and reach [m] of each spring.
    start : float
        Distance [m] from the curve within which hands begin.
    limiter : ForceLimiter
        Bounds the force of the device.
    """
    stores = (
        sum(spring_store(stiffness, min(reach, most), limiter.peak) for stiffness, reach in springs)
        for most in (WORKSPACE_WIDTH, start)
    )
    power, capacity, initial = (max(number, _MIN_BUDGET) for number in (power, *stores))
    drain_time = max(EnergyTank.drain_time, 2.0 * limiter.period)  # two periods are the least that a tank accepts
    return EnergyTank(limiter.period, power, capacity, drain_time, initial)


def fastest(curve: Trajectory) -> float:
    """Greatest |φ̇| at `_SAMPLE_COUNT` phases [m/s]."""
    return float(np.linalg.norm(curve.velocity(np.linspace(curve.start, curve.end, _SAMPLE_COUNT)), axis=1).max())
