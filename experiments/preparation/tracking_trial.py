"""Trial of a clip: how well the physical figure tracks it, without a hand or a map."""

from collections.abc import Callable

from experiments.preparation.followed import MAX_ROOT_TRACKING_ERROR, TRIAL_SECONDS, Followed
from models.mocap.motion.clip import Clip, pose_errors
from sim.body.tracking import TrackingConfig, report, tracked_motion
from sim.compilation.units import Unit


def followed(
    clip: Clip, seconds: float = TRIAL_SECONDS, ready: Callable[[tuple[Unit, ...]], None] = lambda units: None
) -> Followed:
    """Let the physical figure track a clip; `ready` is called with the compilation units that this needs."""
    motion = tracked_motion(clip, seconds, TrackingConfig(), ready)
    root_errors = pose_errors(motion.poses, motion.reference.poses)[1]
    tracking = report(motion)
    fall_times = [*motion.reference.times[root_errors > MAX_ROOT_TRACKING_ERROR][:1].tolist(), *tracking.falls[:1]]
    return Followed(tracking.stance.force_rms, min(fall_times, default=None), seconds)
