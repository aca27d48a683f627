"""Faults of a map's animation, and trials, before a run, of how the physical figure follows it; results are cached."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.console.progress import working
from experiments.files.array_cache import cached_array
from geometry.arrays import Array
from models.humanoid.skeleton import CONTACT_RADIUS
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from models.mocap.preparation.bounds import MAX_RESIDUAL_IN_FLIGHTS
from sim.compilation.unit_workers import compile_units

MAX_FOOT_SKATE = 0.02
"""Largest foot skate of a blend, in 95 % of the stances [m]: the bound of docs/validation/blended-motions.md."""

# Largest floor penetration [m], the bound of docs/validation/blended-motions.md, and largest excess of a joint [rad].
MAX_PENETRATION, MAX_JOINT_EXCESS = 0.01, np.deg2rad(5.0)

TRIAL_SECONDS, FPS = 20.0, 120.0
"""Least duration of a trial [s], and frame rate of the animation that is followed [1/s]: that of prepared clips."""


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


class Verdict(NamedTuple):
    """How the physical figure follows a map.

    Attributes
    ----------
    residual : float
        RMS of the residual force [body weights].
    fell : float
        Time at which it fell [s]; infinite if it did not.
    """

    residual: float
    fell: float

    @property
    def falls(self) -> bool:
        """Whether it falls."""
        return bool(np.isfinite(self.fell))

    @property
    def acceptable(self) -> bool:
        """Whether it does not fall and its residual is at most `MAX_RESIDUAL_IN_FLIGHTS`."""
        return not self.falls and self.residual <= MAX_RESIDUAL_IN_FLIGHTS

    def is_better(self, other: "Verdict", gain: float) -> bool:
        """Whether the figure falls later than in another one, or else its residual is smaller by more than `gain`."""
        return (-self.fell, self.residual) < (-other.fell, other.residual - gain)

    def __str__(self) -> str:
        """In words, as the end of a sentence about the figure."""
        return (
            f"falls at {self.fell:.1f} s" if self.falls else f"has a residual of {100 * self.residual:.0f} % of weight"
        )


class Trial(NamedTuple):
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

    def verdict(self) -> Verdict:
        """How the figure follows."""

        def find() -> Array:
            from experiments.preparation.tracking_trial import followed  # imported late: loads signal processing

            with working("following the blend"):
                result = followed(self.show(), self.seconds, compile_units)
            return np.array([[result.residual, np.inf if result.fell is None else result.fell]])

        return Verdict(*self._cached("verdict", 2, find))

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
