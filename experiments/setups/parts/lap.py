"""The circle of a map: its lap is as configured, or else one that suits the map's clips."""

from dataclasses import replace

from controllers.curves.trajectory import Trajectory
from experiments.config.maps import Composite, Cylindrical, Led, Map, MapFile, RiverClips, RobotArm
from models.mocap.library import embedded_names

DEFAULT_LAP = 4.0
"""Duration of a lap [s] about a map's circle that plays embedded clips only, or none."""


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
    """Remark on a lap that was chosen by the clips of a map, in a run of this duration [s].

    There is none if the lap was given, or is the default.
    """
    if isinstance(given, Led) or isinstance(filled, Led) or given.around.lap is not None:
        return ()
    lap = filled.around.lap
    if lap is None or lap == DEFAULT_LAP:
        return ()
    changes = "; --lap changes it"
    if seconds < lap:
        changes = f", and this run of {seconds:g} s ends before it does; --seconds and --lap change that"
    return (f"a lap takes {lap:.1f} s, which suits these clips best{changes}",)


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
    if set(part.clips) <= set(embedded_names()):
        return DEFAULT_LAP
    # Imported late: they load splines, which a check of gains does not need.
    from experiments.fitting.blendable import best_lap, timing_clip
    from experiments.setups.parts.clips import load_clips

    clips, _ = load_clips(part.clips, part.raw)
    timing = 0 if isinstance(part, Composite) else timing_clip(clips)
    return best_lap(clips, timing, isinstance(part, RiverClips))
