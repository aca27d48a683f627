r"""The energy that the field of a run may inject: the certificate's power, and what its springs hold.

A tank is such that a run as it is meant never empties it, and that a wrong or late law does.

.. math:: P = \tfrac14 b_d |\dot\varphi|^2_{max}

is what the damper of a river injects at most (see `controllers.certificates.loop.energy`), the sum of it for several
rivers. The tank holds at first what the springs give to a hand that begins at the edge of the map's domain, and at most
what they hold with the limiter's force: that is what a hand that has drawn them gets back. Of a field that is not known
here the limiter's force and the curve's pace bound the power, and its force across the workspace the store.
"""

from collections.abc import Sequence

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.safety.energy_tank import EnergyTank, spring_store
from controllers.safety.limiter import ForceLimiter

SPAN = 0.2  # [m] through which a spring can be drawn: across the workspace
_LEAST = 1e-3  # [W], [J] for a field without springs or dampers, whose work is measured by encoders that round
_SAMPLES = 512  # of a curve, in the search for its fastest place


def tank_for(power: float, springs: Sequence[tuple[float, float]], start: float, limiter: ForceLimiter) -> EnergyTank:
    """Tank of a power [W] and of springs.

    Parameters
    ----------
    power : float
        What dampers inject [W].
    springs : sequence of (float, float)
        Stiffness [N/m] and reach [m] of each.
    start : float
        Distance [m] from the curve within which hands begin.
    limiter : ForceLimiter
        What the device may be asked for.
    """
    stores = (sum(_store(spring, most, limiter.peak) for spring in springs) for most in (SPAN, start))
    power, capacity, initial = (max(number, _LEAST) for number in (power, *stores))
    # In this time a full tank may be emptied, at any servo period.
    return EnergyTank(limiter.period, power, capacity, max(0.05, 2.0 * limiter.period), initial)


def _store(spring: tuple[float, float], most: float, force: float) -> float:
    stiffness, reach = spring
    return spring_store(stiffness, min(reach, most), force)


def fastest(curve: Trajectory) -> float:
    """Greatest |φ̇| [m/s]."""
    return float(np.linalg.norm(curve.velocity(np.linspace(curve.start, curve.end, _SAMPLES)), axis=1).max())
