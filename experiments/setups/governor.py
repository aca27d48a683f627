"""How fast a stylus may go along a curve for the flights of the animation under it, and a field that says so."""

from dataclasses import dataclass

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.governor import Governor
from controllers.fields.law import Law, Program
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.river_clips import RiverClips, change_clip
from controllers.state import Array
from experiments.config.modes import SpeedGovernor
from experiments.setups.parts import ClipMapParts
from models.mocap.clip import Clip
from sim.reference.reference import poses_along

_FPS = 120.0  # of the animation whose flights are judged [1/s]
_FASTEST = 10.0  # [m/s], for where nothing bounds the speed: no hand is faster


def animation_along(haptic_map: ClipMap, curve: Trajectory, river: int = 0) -> Clip:
    """The animation h∘φ of one pass of a curve at the pace of the map's clips, in a map of rivers at that of its own.

    Parameters
    ----------
    haptic_map : ClipMap
        h, of the figure.
    curve : Trajectory
        φ, in the hand frame H.
    river : int
        Which river of the map the curve is, if it is a map of rivers.
    """
    (kind, params, memory), seconds = haptic_map.compiled(), haptic_map.lap_seconds
    if isinstance(haptic_map, RiverClips):
        change_clip(memory, float(river), curve.start)
        seconds = haptic_map.loops[river].duration
    frames = max(64, round(_FPS * seconds)) + 1
    points = curve.point(np.linspace(curve.start, curve.end, frames))
    stylus = np.hstack((points, np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))))
    poses = np.empty((frames, haptic_map.nq))
    poses_along(kind, params, memory, stylus, poses)
    return Clip(poses, (frames - 1) / seconds, "along the curve")


def speeds_along(haptic_map: ClipMap, curve: Trajectory, river: int = 0, course: Trajectory | None = None) -> Array:
    """Least and greatest speed [m/s] of a stylus along a curve, as `River.speeds` and `Governor` take them.

    What is judged is the animation h∘φ that the map makes of the curve: the clip itself where the curve is in a place
    of one clip only, and the blend, in the map's own time alignment, where it is between several. A blend that
    never leaves the floor has no flight, whatever its clips do.

    Parameters
    ----------
    haptic_map, curve, river
        Of `animation_along`.
    course : Trajectory, optional
        The curve as a field leads along it, through the same samples at other times (`pace.course_of`); by default
        as it is.

    Returns
    -------
    Array, shape (m, 2)
        At m phases equally spaced from the course's start to its end.

    Raises
    ------
    ModelError
        If the map's poses are not the figure's.
    """
    from experiments.flights.ballistics import (
        clip_ballistics,  # statistics take long to import, for a run without a governor
    )

    clip, led = animation_along(haptic_map, curve, river), curve if course is None else course
    shown = np.linspace(led.start, led.end, clip.n_frames)
    phases = np.interp(shown, np.asarray(led.times), np.asarray(curve.times))
    share = np.clip((phases - curve.start) / curve.duration, 0.0, 1.0)
    # |φ̇| when a pass takes as long as the clips do.
    recorded = np.linalg.norm(curve.velocity(phases), axis=1) * curve.duration
    low, high = clip_ballistics(clip).bounds.stylus_speed(share, recorded / clip.duration)
    # What rises for ever falls at no rate: nothing can be asked of the hand.
    low = np.where(np.isfinite(low), low, 0.0)
    return np.stack((np.minimum(low, _FASTEST), np.minimum(high, _FASTEST)), axis=1)


def governed(governor: SpeedGovernor | None, law: Law, course: Trajectory, maps: ClipMapParts) -> tuple[Law, float]:
    """A field over a course with the governor of the animation under it, and the speed [m/s] to which it urges a hand.

    What is judged is the animation at the pace of the map's own curve: to that the Phantom's friction brings a hand
    which is led along the course.

    Raises
    ------
    ModelError, ControllerError
        If the map's poses are not the figure's, or a number is out of its interval.
    """
    if governor is None:
        return law, 0.0
    speeds = speeds_along(maps.haptic_map, maps.curve, course=course)
    made = Governor(course, speeds, governor.governor_drag, maps.reach)
    return Governed(law, made), float(speeds[:, 0].max())


@dataclass(frozen=True, eq=False)
class Governed(Law):
    """A field over a curve together with the governor of the animation under it."""

    field: Law
    governor: Governor

    def program(self) -> Program:
        """Compiled form of the sum."""
        return self.field + self.governor
