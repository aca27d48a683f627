"""Speeds along a curve at which the flights of its animation are ballistic enough, and a field that governs them."""

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law
from controllers.fields.governor import Governor
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.river_clips import RiverClips
from controllers.haptic_map.river_memory import change_clip
from controllers.state import stylus_path
from experiments.config.modes import SpeedGovernor
from experiments.setups.parts.part_types import ClipMapParts
from geometry.arrays import Array
from models.mocap.motion.clip import Clip
from sim.reference.reference import map_poses

_FRAME_RATE = 120.0  # [1/s] frame rate of the animation whose flights are judged
_MAX_SPEED = 10.0  # [m/s] bound where there is no other: no hand is faster


def animation_along(haptic_map: ClipMap, curve: Trajectory, river: int = 0) -> Clip:
    """The animation h∘φ of a curve at the pace of the map's clips; on a river, of a round at that of its own clip.

    Parameters
    ----------
    haptic_map : ClipMap
        h, from stylus poses to poses of the figure.
    curve : Trajectory
        φ, in the hand frame H.
    river : int
        Which river of the map the curve is, if it is a map of rivers.
    """
    compiled, seconds, laps = haptic_map.compiled(), haptic_map.lap_seconds, 1
    memory = compiled.memory
    if isinstance(haptic_map, RiverClips):
        change_clip(compiled.params, memory, float(river), curve.start)
        seconds, laps = haptic_map.loops[river].duration, haptic_map.laps
    frames = max(64, round(_FRAME_RATE * seconds)) + 1
    stylus = stylus_path(curve.point(np.linspace(curve.start, curve.start + laps * curve.duration, frames)))
    return Clip(map_poses(haptic_map, stylus, memory), (frames - 1) / seconds, "along the curve")


def speeds_along(maps: ClipMapParts, curve: Trajectory, river: int = 0, course: Trajectory | None = None) -> Array:
    """Least and greatest speed [m/s] of a stylus along a curve, as `River.speeds` and `Governor` take them.

    The animation h∘φ along the curve is judged: the clip itself where only one clip plays, and between clips their
    blend, in the map's own time alignment. A blend that never leaves the floor has no flight, even if its clips do.

    Parameters
    ----------
    maps : ClipMapParts
        Parts of the map. The animation is that of the default figure; one of size s falls as it does at 1/√s the pace.
    curve, river
        As in `animation_along`.
    course : Trajectory, optional
        The curve along which a field leads, with the same samples at other times (`pace.course_of`); by default
        the curve itself.

    Returns
    -------
    Array, shape (m, 2)
        At m phases equally spaced from the course's start to its end.

    Raises
    ------
    ModelError
        If the map's poses are not the figure's.
    """
    # Statistics take long to import, for a run without a governor.
    from experiments.flights.ballistics import clip_ballistics

    clip, led = animation_along(maps.haptic_map, curve, river), curve if course is None else course
    shown = np.linspace(led.start, led.end, clip.n_frames)
    phases = np.interp(shown, np.asarray(led.times), np.asarray(curve.times))
    share = np.clip((phases - curve.start) / curve.duration, 0.0, 1.0)
    # |φ̇| when a pass takes as long as the clips do.
    recorded = np.linalg.norm(curve.velocity(phases), axis=1) * curve.duration
    laps = maps.haptic_map.laps if isinstance(maps.haptic_map, RiverClips) else 1
    bounds, speed = clip_ballistics(clip).bounds, recorded * laps / clip.duration / np.sqrt(maps.size)
    # Of several laps, the narrowest interval: a field does not know which of them the hand is in.
    found = [bounds.stylus_speed((lap + share) / laps, speed) for lap in range(laps)]
    low, high = np.max([low for low, _ in found], axis=0), np.min([high for _, high in found], axis=0)
    # Where the least speed is infinite, no speed makes the motion ballistic: none is demanded of the hand.
    low = np.minimum(np.where(np.isfinite(low), low, 0.0), high)
    return np.stack((np.minimum(low, _MAX_SPEED), np.minimum(high, _MAX_SPEED)), axis=1)


def governed(governor: SpeedGovernor | None, law: Law, course: Trajectory, maps: ClipMapParts) -> tuple[Law, float]:
    """A field with the governor for the animation along its course, and the largest speed [m/s] to which it urges.

    The animation is judged at the pace of the map's own curve, which is the pace of a hand that is led along the course
    against the Phantom's friction.

    Raises
    ------
    ModelError, ControllerError
        If the map's poses are not the figure's, or a number is out of its interval.
    """
    if governor is None:
        return law, 0.0
    speeds = speeds_along(maps, maps.curve, course=course)
    added = Governor(course, speeds, governor.governor_drag, maps.reach)
    return law + added, float(speeds[:, 0].max())
