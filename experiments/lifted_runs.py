"""Runs on a lifted map: FOLLOW traces one of its curves, and all of them together are rivers."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bundle import RiverBundle
from controllers.fields.river import River
from controllers.haptic_map.lifted import Lifted
from experiments.config import RunConfig
from sim.world import phantom_angles


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
    """A river for every clip, by its name.

    Raises
    ------
    ParameterError
        If a gain is out of its interval.
    """
    if config.damping <= 0.0 or config.stiffness <= 0.0:
        raise ParameterError(
            f"a river's time is damping/stiffness: both must be positive, got {config.damping}, {config.stiffness}"
        )
    tau = config.damping / config.stiffness
    curves = [haptic_map.curve(i) for i in range(len(haptic_map.names))]
    return RiverBundle(
        tuple(River(curve, config.river_tube, tau, config.damping) for curve in curves), haptic_map.names
    )
