"""Maps of clips about a circle: their place, the motions that they take, their pace in a lap, the parts of a run."""

from collections.abc import Sequence
from typing import NamedTuple

from controllers.curves.cylinder import AXIS
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap
from controllers.motion.strides import fit_to_lap
from experiments.config.maps import Composite, Cylindrical, RiverClips
from experiments.fitting.blendable import all_same, not_blendable
from experiments.fitting.suitable_laps import closed_loops, lap_suits_blend, off_pace
from experiments.setups.modes.rivers import default_choice
from experiments.setups.parts.hands import river_pushes
from experiments.setups.parts.lap import circle_of
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import ClipMapParts
from geometry.arrays import Array
from models.mocap.motion.clip import Clip


class Place(NamedTuple):
    """The curve of a map of clips, and the map's domain about it.

    Attributes
    ----------
    curve : Trajectory
        A lap about the z axis, with the timing that the hand is to have.
    radius : float
        Radius of the middle of the domain [m].
    reach : float
        Half width of the domain in radius and in height [m].
    expressive : bool
        Whether the stylus's orientation turns the figure.
    """

    curve: Trajectory
    radius: float
    reach: float
    expressive: bool

    def radii(self) -> tuple[float, float]:
        """Ends of the domain in radius [m]; raises `ParameterError` if it reaches the axis, where phases meet."""
        if self.radius - self.reach <= AXIS:
            raise ParameterError(
                f"reach is {self.reach:g} m about a curve of radius {self.radius:.3g} m; expected less than "
                f"{max(self.radius - AXIS, 0.0):.3g} m, so that the map ends before the axis, or a larger radius"
            )
        return self.radius - self.reach, self.radius + self.reach


def place_of(part: Cylindrical | Composite | RiverClips) -> Place:
    """The place of a configured map; raises `SimError` if the Phantom does not reach its curve."""
    return Place(check_reach(circle_of(part)), part.around.radius, part.reach, part.expressive)


def about_circle(place: Place, haptic_map: AnimationMap, clips: tuple[Clip, ...], timing: int | None) -> ClipMapParts:
    """Map parts of a map of clips about a circle; `timing` is the clip whose pace an advised lap keeps (`best_lap`)."""
    curve, reach = place.curve, place.reach
    played = _repeated(clips, len(haptic_map.loops))
    off = off_pace(played, haptic_map.loops, curve.duration, haptic_map.laps, timing)
    return ClipMapParts(
        haptic_map=haptic_map, clips=clips, curve=curve, reach=reach,
        rivers=lambda mode: default_choice(mode, curve, reach),
        river_pushes=lambda mode, seconds: river_pushes(curve, seconds),
        moves=True, expressive=place.expressive,
        remarks=(*not_blendable(clips), *off),
    )  # fmt: skip


def check_clips(clips: Sequence[Clip], most: int, name: str) -> None:
    """Refuse more clips than a map takes, or none.

    Raises
    ------
    ParameterError
        If so; the message names the map and how many clips it takes.
    """
    if not 1 <= len(clips) <= most:
        raise ParameterError(f"got {len(clips)} --clips; expected 1 to {most} for the {name} map")


def _repeated(clips: Sequence[Clip], count: int) -> list[Clip]:
    return [clips[i % len(clips)] for i in range(count)]


def played_clips(clips: Sequence[Clip], count: int, name: str) -> list[Clip]:
    """The clips that a map plays: those given, repeated until there are `count`; raises as `check_clips`."""
    check_clips(clips, count, name)
    return _repeated(clips, count)


def motions_of(played: Sequence[Clip]) -> list[tuple[Array, float]]:
    """Poses and frame rates of clips, as maps take them."""
    return [(clip.poses, clip.fps) for clip in played]


def out_of_step(played: Sequence[Clip], lap: float) -> bool:
    """Whether a lap [s] with all clips in step would play some of them too far from their own pace."""
    return not all_same(played) and not lap_suits_blend(played, fit_to_lap(closed_loops(played), lap), lap)
