"""Faults of an animation: force that contact cannot give, soles below the floor, foot skate; and their bounds."""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.motion.clip import Clip

MAX_FOOT_SKATE = 0.02
"""Largest foot skate of a blend, in 95 % of the stances [m]: the bound of docs/validation/blended-motions.md."""

# Largest floor penetration [m], the bound of docs/validation/blended-motions.md, and largest excess of a joint [rad].
MAX_PENETRATION, MAX_JOINT_EXCESS = 0.01, np.deg2rad(5.0)


class MotionFaults(NamedTuple):
    """Measures of a motion's faults.

    Attributes
    ----------
    residual : float
        RMS of the force that floor contact cannot give, by inverse dynamics [body weights].
    lowest : float
        Height of the lowest point of the soles [m].
    skate, furthest : float
        Foot skate (`models.mocap.preparation.skate`), hands included: 95th percentile of the stances and largest [m].
    """

    residual: float
    lowest: float
    skate: float
    furthest: float


def motion_faults(poses: Array, fps: float) -> MotionFaults:
    """Measure a motion (n, 75)."""
    # Imported here: they load signal processing, which a run with cached results does not need.
    from models.mocap.motion.kinematics import sole_points
    from models.mocap.preparation.contact_loads import contact_forces
    from models.mocap.preparation.poses import smoothed
    from models.mocap.preparation.skate import skates
    from models.mocap.preparation.stances import stances

    clip = Clip(poses, fps, "blend")
    schedule = stances(clip, smoothed(clip))
    support = contact_forces(clip, schedule)
    found, lowest = skates(clip, schedule, support.loads), sole_points(poses)[:, :, 2].min() - CONTACT_RADIUS
    return MotionFaults(support.residual, float(lowest), float(np.quantile(found, 0.95)), float(found.max()))
