"""How the physical figure follows a clip alone: what preparing it is for."""

from collections.abc import Callable
from time import process_time
from typing import NamedTuple

import numpy as np

from models.mocap.clip import Clip, pose_difference
from sim.body.tracking import TrackingConfig, report, tracked_motion
from sim.compilation.units import Unit

SECONDS = 20.0  # followed
FALLEN = 1.0  # m between the root and its reference
FEASIBLE, LEAPING = 0.05, 0.12  # body weights RMS that are bearable, of gaits and gestures, and of jumps and fights


class Followed(NamedTuple):
    """How the physical figure followed a clip.

    Attributes
    ----------
    residual : float
        RMS of the residual force while the reference stands [body weights].
    fell : float or None
        When it first fell, or its root was `FALLEN` from its reference [s].
    seconds : float
        For how long it was to follow [s].
    cost : float
        Processor time of simulating a second [s].
    """

    residual: float
    fell: float | None
    seconds: float
    cost: float

    @property
    def stands(self) -> bool:
        """Whether it did not fall, with a residual that is bearable."""
        return self.fell is None and self.residual <= LEAPING

    def __str__(self) -> str:
        """In percent, with the time of the fall in brackets."""
        return f"{100 * self.residual:.1f}" + ("" if self.fell is None else f" [{self.fell:.1f} s]")

    def line(self) -> str:
        """In words."""
        lacks = f"{100 * self.residual:.1f} % of weight"
        if self.fell is not None:
            return f"the physical figure falls at {self.fell:.1f} s, with a residual of {lacks} up to then"
        return f"the physical figure follows it for {self.seconds:.0f} s with a residual of {lacks}"

    def faults(self, leaps: bool) -> tuple[str, ...]:
        """What is not within bounds, of a clip that leaves the floor or does not."""
        bound = LEAPING if leaps else FEASIBLE
        if self.fell is not None:
            return (f"the physical figure falls at {self.fell:.1f} s",)
        if self.residual > bound:
            return (f"the physical figure lacks {100 * self.residual:.0f} % of weight; {100 * bound:.0f} at most",)
        return ()


def followed(
    clip: Clip, seconds: float = SECONDS, ready: Callable[[tuple[Unit, ...]], None] = lambda units: None
) -> Followed:
    """Let the physical figure follow a clip; `ready` is called with what is to be compiled for it."""
    began = process_time()
    motion = tracked_motion(clip, seconds, TrackingConfig(), ready)
    cost = (process_time() - began) / seconds
    away = np.linalg.norm(pose_difference(motion.poses, motion.reference.poses)[:, :3], axis=1)
    told = report(motion)
    fallen = [*motion.reference.times[away > FALLEN][:1].tolist(), *told.falls[:1]]
    return Followed(told.residual_force, min(fallen, default=None), seconds, cost)
