"""Trials, before a run, of a map's animation: whether it is sound and the physical figure follows it; cached."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.console.progress import working
from experiments.files.array_cache import cached_array
from experiments.fitting.motion_faults import MAX_FOOT_SKATE, MAX_JOINT_EXCESS, MAX_PENETRATION, motion_faults
from experiments.preparation.followed import Followed
from geometry.arrays import Array
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from sim.compilation.unit_workers import compile_units

FPS = 120.0
"""Frame rate of the animation that is followed [1/s]: that of prepared clips."""


class AnimationTrial(NamedTuple):
    """An animation that the physical figure is to follow; what is found is cached, and needs compiled code.

    Attributes
    ----------
    module : str
        Dotted name of the module that makes the animation: a change of its code invalidates the cache.
    show : callable
        Makes the animation.
    seconds : float
        Duration for which the figure follows [s].
    made_of : iterable of arrays
        Everything else that the animation depends on.
    """

    module: str
    show: Callable[[], Clip]
    seconds: float
    made_of: Iterable[npt.NDArray[np.generic]]

    def followed(self) -> Followed:
        """How the figure follows."""

        def find() -> Array:
            from experiments.preparation.tracking_trial import followed  # imported late: loads signal processing

            with working("following the blend"):
                result = followed(self.show(), self.seconds, compile_units)
            return np.array([[result.residual, np.inf if result.fell is None else result.fell]])

        residual, fell = self._cached("followed", 2, find)
        return Followed(residual, fell if np.isfinite(fell) else None, self.seconds)

    def is_sound(self, in_every_stance: bool = False) -> bool:
        """Whether soles neither penetrate the floor nor skate and joints stay within their ranges, by tolerances.

        Feet may skate in a twentieth of the stances, or in none.
        """

        def find() -> Array:
            shown = self.show()
            faults = motion_faults(shown.poses, shown.fps)
            return np.array([[faults.lowest, faults.skate, faults.furthest, beyond_ranges(shown.poses).max()]])

        lowest, skate, furthest, beyond = self._cached("sound", 4, find)
        skate = furthest if in_every_stance else skate
        return bool(lowest > -MAX_PENETRATION and skate <= MAX_FOOT_SKATE and beyond < MAX_JOINT_EXCESS)

    def _cached(self, name: str, count: int, find: Callable[[], Array]) -> list[float]:
        return cached_array(self.module, name, self.made_of, (1, count), find)[0].tolist()
