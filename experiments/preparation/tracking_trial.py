"""Trial of a clip: how well the physical figure tracks it, without a hand or a map."""

from collections.abc import Callable
from time import process_time
from typing import NamedTuple

from models.mocap.motion.clip import Clip, pose_errors
from models.mocap.preparation.bounds import MAX_RESIDUAL, MAX_RESIDUAL_IN_FLIGHTS, exceeding_text
from sim.body.tracking import TrackingConfig, report, tracked_motion
from sim.compilation.units import Unit

TRIAL_SECONDS = 20.0  # default duration of a trial
MAX_ROOT_TRACKING_ERROR = 1.0  # distance of the root from its reference that counts as a fall [m]


class Followed(NamedTuple):
    """How the physical figure followed a clip.

    Attributes
    ----------
    residual : float
        RMS residual force while the reference stands, until the end of a clip that is not repeated [body weights].
    fell : float or None
        Time at which it fell, or its root was `MAX_ROOT_TRACKING_ERROR` from its reference [s]; None if neither.
    seconds : float
        Duration of the trial [s].
    cost : float
        Processor time per simulated second [s/s].
    """

    residual: float
    fell: float | None
    seconds: float
    cost: float

    @property
    def stands(self) -> bool:
        """Whether it did not fall and its residual is at most `MAX_RESIDUAL_IN_FLIGHTS`."""
        return self.fell is None and self.residual <= MAX_RESIDUAL_IN_FLIGHTS

    def __str__(self) -> str:
        """Residual in percent, with the time of a fall in brackets."""
        return f"{100 * self.residual:.1f}" + ("" if self.fell is None else f" [{self.fell:.1f} s]")

    def line(self) -> str:
        """The result in words."""
        residual = f"{100 * self.residual:.1f} % of weight"
        if self.fell is not None:
            return f"the physical figure falls at {self.fell:.1f} s, with a residual of {residual} up to then"
        return f"the physical figure follows it for {self.seconds:.0f} s with a residual of {residual}"

    def faults(self, leaps: bool) -> tuple[str, ...]:
        """Faults, a line each; `leaps` says whether the clip has flights, which raises the bound of the residual."""
        bound = MAX_RESIDUAL_IN_FLIGHTS if leaps else MAX_RESIDUAL
        if self.fell is not None:
            return (f"the physical figure falls at {self.fell:.1f} s",)
        if self.residual > bound:
            residual = exceeding_text(100 * self.residual, 100 * bound)
            return (f"the physical figure has a residual of {residual} % of weight; {100 * bound:.0f} at most",)
        return ()


def followed(
    clip: Clip, seconds: float = TRIAL_SECONDS, ready: Callable[[tuple[Unit, ...]], None] = lambda units: None
) -> Followed:
    """Let the physical figure track a clip; `ready` is called with the compilation units that this needs."""
    began = process_time()
    motion = tracked_motion(clip, seconds, TrackingConfig(), ready)
    cost = (process_time() - began) / seconds
    root_errors = pose_errors(motion.poses, motion.reference.poses)[1]
    tracking = report(motion)
    fall_times = [*motion.reference.times[root_errors > MAX_ROOT_TRACKING_ERROR][:1].tolist(), *tracking.falls[:1]]
    return Followed(tracking.stance.force_rms, min(fall_times, default=None), seconds, cost)
