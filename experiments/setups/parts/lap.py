"""The circle of a map: its lap is as configured, or else one that suits the map's clips."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from controllers.curves.trajectory import Trajectory
from experiments.config.maps import Composite, Cylindrical, Led, Map, MapFile, RiverClips, RobotArm

DEFAULT_LAP = 4.0
"""Duration of a lap [s] about a map's circle that plays embedded clips only, or none."""

# [m/s] With b of 8 N s/m the Phantom's friction of some 50 mN lags a hand by 6 mm/s. The flow compensates for it along
# the curve, but a hand that is pushed aside has its friction along its own path: at 4 mm/s its pace was 1.14.
_MIN_STEADY_SPEED = 0.012


def with_lap(part: Map) -> Map:
    """A map with the duration of its lap filled in, if it has a circle.

    Raises
    ------
    HvfError
        If the configuration leaves the lap open, and a motion file of the map cannot be read or played.
    """
    if isinstance(part, Led):
        return part
    return replace(part, around=replace(part.around, lap=_lap_of(part)))


def lap_remarks(given: Map, filled: Map, seconds: float) -> tuple[str, ...]:
    """Remarks on a lap that was chosen by the clips of a map, in a run of this duration [s].

    There are none if the lap was given, or is the default.
    """
    if isinstance(given, Led) or isinstance(filled, Led) or given.around.lap is not None:
        return ()
    lap = _lap_of(filled)
    changes = "; --lap changes it"
    if seconds < lap:
        changes = f", and this run of {seconds:g} s ends before it does; --seconds and --lap change that"
    remark = f"a lap takes {lap:.1f} s, which suits these clips best{changes}"
    speed = 2.0 * np.pi * filled.around.radius / lap
    slow = (
        f"the hand goes round at {1e3 * speed:.0f} mm/s: so slowly that a push, or a person's unsteady hand, changes "
        "the clips' pace by a tenth and more, and the figure may fall; shorter clips or a larger --radius help"
    )
    return () if lap == DEFAULT_LAP else (remark, slow) if speed < _MIN_STEADY_SPEED else (remark,)


def circle_of(part: Cylindrical | Composite | RiverClips | MapFile | RobotArm) -> Trajectory:
    """The circle of a map, with the timing that the hand is to have.

    Raises
    ------
    HvfError
        As `with_lap`.
    """
    return Trajectory.circle(part.around.radius, _lap_of(part), wave=part.around.wave)


def _lap_of(part: Cylindrical | Composite | RiverClips | MapFile | RobotArm) -> float:
    if part.around.lap is not None:
        return part.around.lap
    if not any(Path(name).suffix for name in part.clips):  # embedded clips have names without
        return DEFAULT_LAP
    # Imported late: they load splines, which a check of gains does not need.
    from experiments.fitting.suitable_laps import best_lap, timing_clip
    from experiments.setups.parts.clips import load_clips

    clips, _ = load_clips(part.clips, part.raw)
    timing = None if isinstance(part, RiverClips) else 0 if isinstance(part, Composite) else timing_clip(clips)
    return best_lap(clips, timing)
