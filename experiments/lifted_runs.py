"""Runs on a lifted map: FOLLOW traces one of its curves, and all of them together are rivers."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.river import River
from controllers.haptic_map.lifted import Lifted
from controllers.state import Array
from experiments.config import RunConfig
from experiments.modes import river_time
from experiments.pace import paced
from sim.users.intent import Grab
from sim.world import phantom_angles

_LEAD = 0.41  # [rad] before and behind a transition, between which a hand changes over
_OVERSHOOT = 0.9  # of the distance of the curves


def curve_number(haptic_map: Lifted, curve: str) -> int:
    """Which curve a name, or a number as text, means; the first for an empty one.

    Raises
    ------
    ParameterError
        If the map has none of that name.
    """
    if not curve:
        return 0
    if curve in haptic_map.names:
        return haptic_map.names.index(curve)
    if curve.isdecimal() and int(curve) < len(haptic_map.names):
        return int(curve)
    raise ParameterError(
        f"no curve {curve!r} in the map; there are {', '.join(haptic_map.names)}, or 0 to {len(haptic_map.names) - 1}"
    )


def lifted_curve(haptic_map: Lifted, curve: str) -> Trajectory:
    """The curve that a run begins on, at its clip's pace.

    Raises
    ------
    ParameterError
        If the map has none of that name.
    SimError
        If the Phantom does not reach it.
    """
    found = haptic_map.curve(curve_number(haptic_map, curve))
    for phase in np.linspace(found.start, found.end, 64):
        phantom_angles(found.point(phase))
    return found


def lifted_rivers(haptic_map: Lifted, config: RunConfig) -> RiverBundle:
    """A river for every clip, by its name, that leads the Phantom at the clip's pace (`paced`).

    Raises
    ------
    ParameterError
        If a gain is out of its interval.
    SimError
        If the Phantom does not reach a curve.
    """
    tau = river_time(config)
    curves = [paced(haptic_map.curve(i), config.damping) for i in range(len(haptic_map.names))]
    return RiverBundle(
        tuple(River(curve, config.river_tube, tau, config.damping) for curve in curves), haptic_map.names
    )


def lifted_course(curve: Trajectory, config: RunConfig) -> Trajectory:
    """The curve along which the field of a run leads, so timed that friction leaves the hand the pace of `curve`.

    Raises
    ------
    SimError
        If the Phantom does not reach the curve.
    """
    led = config.mode in ("follow", "rivers") and config.damping > 0.0
    return paced(curve, config.damping) if led else curve


def carried_over(haptic_map: Lifted, first: int, second: int, angle: float, start: float) -> Grab:
    """A hand that carries the stylus from one curve to another past the transition between them.

    From `_LEAD` before the transition on the first curve to `_LEAD` behind it on the second, and beyond it, because an
    arm yields: it stays behind where it means to be. It moves at about the pace of the curves: one that carried the
    stylus from rest to rest would stop the figure.

    Parameters
    ----------
    haptic_map : Lifted
    first, second : int
        The curves.
    angle : float
        θ of the transition [rad].
    start : float
        When the stylus is at the first place [s].
    """
    before, behind = angle - _LEAD, angle + _LEAD
    here, there = _point(haptic_map, first, before), _point(haptic_map, second, behind)
    beyond = _OVERSHOOT * (there - _point(haptic_map, first, behind))
    x, y, z = (float(value) for value in there + beyond - here)
    return Grab(start, (x, y, z), duration=0.3, hold=0.0, steady=True)


def _point(haptic_map: Lifted, curve: int, angle: float) -> Array:
    r, z = haptic_map.site(curve, np.array(angle))
    return np.array([r * np.cos(angle), r * np.sin(angle), z])
