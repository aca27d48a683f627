"""The energy that the field of a run may inject: the certificate's power, and what its springs hold."""

from collections.abc import Sequence

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.safety.energy_tank import EnergyTank, river_power, spring_store
from controllers.safety.limiter import ForceLimiter
from experiments.config.run_config import STRETCHING, RunConfig
from experiments.setups.modes import river_bundle
from sim.users.intent import Grab

SPAN = 0.2  # [m] through which a spring can be drawn: across the workspace
_BEND = 2.0  # steepest slope of a bump of height and half width 1, and a little more
_LEAST = 1e-3  # [W], [J] for a field without springs or dampers, whose work is measured by encoders that round
_SAMPLES = 512  # of a curve, in the search for its fastest place


def energy_tank(
    config: RunConfig, curve: Trajectory, limiter: ForceLimiter, grabs: Sequence[Grab] = (), urged: float = 0.0
) -> EnergyTank:
    r"""Tank that a run as it is meant never empties, and that a wrong or late law does.

    .. math:: P = \tfrac14 b_d |\dot\varphi|^2_{max}

    is what the damper of a river injects at most (see `controllers.certificates.loop.energy`), the sum of it for
    several
    rivers; a bunny's spring is carried along besides, min(k_r δ e^{-1/2}, F_p) |φ̇|. The tank holds at first what the
    springs give to a hand that begins at the edge of the map's domain, and at most what they hold with the limiter's
    force: that is what a hand that has drawn them gets back. Of a field that is not known here the limiter's force and
    the curve's pace bound the power, and its force across the workspace the store.

    Parameters
    ----------
    config : RunConfig
        Mode, gains and widths.
    curve : Trajectory
        φ, in the hand frame H.
    limiter : ForceLimiter
        What the device may be asked for.
    grabs : sequence of Grab
        What the hand takes hold of, by which a bent curve may become faster.
    urged : float
        Speed [m/s] to which a governor urges the hand.
    """
    pace, force = fastest(curve), limiter.peak
    stiffness, damping = config.gains
    damped = river_power(damping, pace)
    springs: tuple[tuple[float, float], ...] = ((stiffness, config.tube),)
    if config.mode == "follow":
        power = damped
    elif config.mode == "bunny":
        # ∫ k s exp(−s²/2δ²) ds = k δ² is what a spring of reach √2 δ holds.
        springs = ((stiffness, np.sqrt(2.0) * config.bunny_width),)
        power = damped + pace * min(stiffness * config.bunny_width * np.exp(-0.5), force)
    elif config.mode == "rivers":
        bundle = river_bundle(curve, config.reach, damping / stiffness, damping, config.river_tube)
        springs = ((stiffness, config.river_tube),) * len(bundle.rivers)
        power = sum(river_power(damping, fastest(river.curve)) for river in bundle.rivers)
    elif config.mode in STRETCHING:
        # A press of the switch leaves the search for the rubber: its energy once a second.
        springs, power = ((max(config.seek, config.rubber), SPAN),), spring_store(config.rubber, config.rubber_tube)
        if config.mode == "stretch-then-follow":
            carried = max((float(np.linalg.norm(grab.carry)) for grab in grabs), default=0.0)
            springs, power = (
                (*springs, (stiffness, config.tube)),
                power + river_power(damping, pace + _BEND * carried / config.bump),
            )
    else:
        power, springs = force * pace, ((np.inf, SPAN),)
    return tank_for(power + river_power(config.governor_drag, urged), springs, config.reach, limiter)


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
