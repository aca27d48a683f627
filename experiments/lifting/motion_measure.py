"""Measures of a motion that a map generates: joint limits, slide of the feet, floor penetration, flights."""

from typing import NamedTuple

import numpy as np

from controllers.certificates.flight.flight_fit import find_flights, fit_free_fall
from experiments.results.measures.soles import Soles
from models.mocap.dynamics.contacts import contacts
from models.mocap.dynamics.momentum import momentum
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.world.scene import SceneConfig


class MotionMeasure(NamedTuple):
    """Largest faults of a motion.

    Attributes
    ----------
    limits : float
        Excess of a joint over its limits [rad].
    slide : float
        Largest slide of a point of the soles (`experiments.results.measures.soles`) [m].
    penetration : float
        Depth of the body below the floor [m].
    ballistic : float
        Distance of the centre of mass from the best-fitting free fall in flights [m]; 0 without a flight.
    """

    limits: float
    slide: float
    penetration: float
    ballistic: float

    @staticmethod
    def worst(measures: "list[MotionMeasure]") -> "MotionMeasure":
        """The largest of each measure; zeros for an empty list."""
        return MotionMeasure(*np.max([MotionMeasure(0.0, 0.0, 0.0, 0.0), *measures], axis=0).tolist())


def measure_motion(clip: Clip) -> MotionMeasure:
    """Measure a clip on the default figure."""
    floor, feet = contacts(clip), Soles(SceneConfig())
    feet.add(clip.poses)
    com = momentum(clip).com
    spans = find_flights(floor.supported, clip.fps)
    return MotionMeasure(
        limits=max(0.0, float(beyond_ranges(clip.poses).max())),
        slide=feet.slide,
        penetration=float(max(0.0, -floor.clearance.min())),
        ballistic=max((fit_free_fall(com[a : b + 1], clip.fps, 1.0)[0] for a, b in spans), default=0.0),
    )
