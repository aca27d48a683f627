"""Types of the parts of a run: `MapParts`, made from a map, and `Parts`, which a mode makes from these."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law, Program
from controllers.fields.bundle import RiverBundle
from controllers.haptic_map.animation import AnimationMap, ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.sized import Sized
from controllers.safety.energy_tank import EnergyTank
from controllers.walking.walking import Walking
from experiments.config.modes import Rivers
from experiments.config.run_config import Clock, Figure, Phantom, Replay
from experiments.results.measures.summary import RunSummary
from experiments.setups.parts.expression import expressive_figure
from geometry.arrays import Array
from models.mocap.motion.clip import Clip
from models.world.scene import SceneConfig
from sim.body.figure import FigureGains
from sim.recording.recording import Recording
from sim.users.hand.actions import Push
from sim.users.hand.arm import Arm
from sim.users.participant import Participant
from sim.world.world import BodyKind

Map = TypeVar("Map", bound=HapticMap, covariant=True)
Static = Mapping[str, npt.ArrayLike | str]
"""Constant data that a recording keeps beside its channels."""


class Settings(Protocol):
    """Settings of a run apart from field, map and hand; `body` is what follows the hand, `scene` the world."""

    @property
    def figure(self) -> Figure: ...  # noqa: D102
    @property
    def device(self) -> Phantom | Replay: ...  # noqa: D102
    @property
    def clock(self) -> Clock: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def body(self) -> BodyKind: ...  # noqa: D102
    @property
    def scene(self) -> SceneConfig: ...  # noqa: D102


class RiverChoice(NamedTuple):
    """The rivers of a run, and how they are told apart.

    Attributes
    ----------
    bundle : RiverBundle
        The rivers, by name.
    given : tuple of Trajectory
        Their curves as the map has them, with the timing that the hand is to have.
    pace : float
        Reference speed [m/s] that scales the thresholds by which the law tells them apart (`rivers.law_of`).
    hysteresis : float
        Margin in favour of the river that already has the hand [m/s].
    ease : float
        Time in which a river brings a hand that it has taken to its own pace [s].
    sigma : float
        σ of the discrete form [m/s]; 0 for that of rivers that cross.
    cross_track : Array, optional
        How the figure follows a hand across rivers (`sim.reference.cross_track`); by default at once.
    """

    bundle: RiverBundle
    given: tuple[Trajectory, ...]
    pace: float
    hysteresis: float
    ease: float = 0.0
    sigma: float = 0.0
    cross_track: Array | None = None


@dataclass(frozen=True, kw_only=True)
class MapParts(Generic[Map]):
    """Parts of a run that depend on the map alone.

    Attributes
    ----------
    haptic_map : HapticMap
        h, from stylus poses to poses of the figure.
    clips : tuple of Clip
        Clips that the map plays.
    curve : Trajectory
        φ, with the timing that the hand is to have.
    refined : callable, optional
        Returns the map improved by what only compiled code can find, and remarks on how the physical figure follows it.
    gains : FigureGains
        Gains of the physical figure.
    moves : bool
        Whether a run begins in motion: a walk at full speed cannot begin from rest.
    expressive : bool
        Whether gaze and lean of the figure follow the stylus's orientation.
    turning : bool
        Whether the map itself takes the stylus's orientation.
    plays_rivers : bool
        Whether every river plays a clip of its own.
    size : float
        Lengths of the figure over those of the figure that the map is made for [1].
    remarks : tuple of str
        Remarks for the user, a line each.
    static : Static
        Constant data for the recording.
    """

    haptic_map: Map
    clips: tuple[Clip, ...]
    curve: Trajectory
    refined: Callable[[], tuple[Map, tuple[str, ...]]] | None = None
    gains: FigureGains = field(default_factory=FigureGains)
    moves: bool = False
    expressive: bool = False
    turning: bool = False
    plays_rivers: bool = False
    size: float = 1.0
    remarks: tuple[str, ...] = ()
    static: Static = field(default_factory=dict)

    @property
    def oriented(self) -> bool:
        """Whether the stylus's orientation moves anything."""
        return self.expressive or self.turning

    @property
    def lap_durations(self) -> Array:
        """Durations of a lap at which each clip that is played runs at its own pace [s]; empty if a lap plays none."""
        return np.empty(0)

    @property
    def lap_seconds(self) -> float:
        """Duration of a lap at which the clips of the legs run at their own pace [s]; NaN if a lap plays none."""
        return math.nan

    @property
    def whole_map(self) -> HapticMap:
        """The map, with gaze and lean if it has them, for the figure's size."""
        whole = expressive_figure(self.haptic_map) if self.expressive else self.haptic_map
        return whole if self.size == 1.0 else Sized(whole, self.size)

    def with_remarks(self, remarks: tuple[str, ...]) -> Self:
        """The same parts with more remarks, put before the present ones."""
        return replace(self, remarks=remarks + self.remarks)

    def refine(self, physical: bool) -> Self:
        """The same parts with the improved map and, for a physical figure, remarks on it; needs compiled code."""
        if self.refined is None:
            return self
        haptic_map, figure_remarks = self.refined()
        return replace(
            self,
            haptic_map=haptic_map,
            remarks=self.remarks + haptic_map.remarks + (figure_remarks if physical else ()),
        )


@dataclass(frozen=True, kw_only=True)
class ClipMapParts(MapParts[ClipMap]):
    """Parts of a run that depend on a map of clips along a curve.

    Attributes
    ----------
    reach : float
        Half width of the map's domain about the curve [m].
    rivers : callable
        Maps a mode to its rivers.
    river_pushes : callable
        Maps the mode and the duration of the run [s] to the pushes of a hand that changes over to another river.
    carry : float
        Factor on the default distances by which a hand bends a curve.
    curve_clip_seconds : float, optional
        Duration of the clip of the curve [s], where every curve of the map has a clip of its own.
    """

    reach: float
    rivers: Callable[[Rivers], RiverChoice]
    river_pushes: Callable[[Rivers, float], tuple[Push, ...]]
    carry: float = 1.0
    curve_clip_seconds: float | None = None

    @property
    def lap_durations(self) -> Array:
        """As in `MapParts`."""
        if self.curve_clip_seconds is not None:
            return np.array([self.curve_clip_seconds])
        return self.haptic_map.lap_durations if isinstance(self.haptic_map, AnimationMap) else np.empty(0)

    @property
    def lap_seconds(self) -> float:
        """As in `MapParts`."""
        if self.curve_clip_seconds is not None:
            return self.curve_clip_seconds
        return self.haptic_map.lap_seconds if isinstance(self.haptic_map, AnimationMap) else math.nan


@dataclass(frozen=True)
class Notes:
    """Titles and labels of a run in figures, replays and recordings.

    Attributes
    ----------
    title : str
        Title of the page: the mode.
    tube_radius : float
        Radius of the tube that is drawn about the curve [m]; 0 for none.
    tube_name : str
        What the tube is.
    distance_from : str
        What the recorded distance is measured from.
    hand_does : str
        What a hand that exerts a force does, as a verb.
    static : Static
        More constant data for the recording.
    """

    title: str
    tube_radius: float
    tube_name: str = "map's domain"
    distance_from: str = "the curve"
    hand_does: str = "pushes"
    static: Static = field(default_factory=dict)


class Measuring(NamedTuple):
    """Data from which a mode's measures of a finished run are computed.

    Attributes
    ----------
    recording : Recording
        Recording of the run.
    default_poses : callable
        Makes a function for the animation of the unedited curve (`session.default_poses`).
    handled : tuple of (float, float)
        Intervals of time [s] in which the hand does something other than push.
    memory, walkers : Array
        The field's memory and the state of its walkers at the end of the run.
    save_curve : callable
        Saves a curve beside the recording.
    """

    recording: Recording
    default_poses: Callable[[], Callable[[Array, Array, Array], Array]]
    handled: tuple[tuple[float, float], ...]
    memory: Array
    walkers: Array
    save_curve: Callable[[Trajectory], None]


@dataclass(frozen=True)
class Parts:
    """All parts of a run, as its mode makes them from the map's parts.

    Attributes
    ----------
    config : Settings
        Figure, device and clock with all defaults filled in; for a configured run, its `RunConfig`.
    maps : MapParts
        The map, its clips and its curve.
    field : Law
        Law of force of the mode.
    program : Program
        The field as it is executed, with moments and walls added.
    course : Trajectory
        Curve along which the field leads.
    user : Arm or Participant
        The simulated hand.
    tank : EnergyTank
        Bounds the energy that the field may inject.
    notes : Notes
        Titles and labels.
    gains : FigureGains
        Gains of the physical figure.
    bends : bool
        Whether the hand bends the curve; the figure then begins at rest.
    held_seconds : float
        Duration of the clips [s] where a hand may hold the figure in the middle of a flight, else 0; where it is
        slower than they are, their flights are lowered to the floor.
    cross_track : Array, optional
        As in `RiverChoice`.
    walking : Walking, optional
        How a figure is led: its walker is the map's argument; without it that is the stylus pose.
    argument_at : callable
        Maps nearest points (n, 3) and phases (n,) to the map's arguments (n, 7) for the default animation.
    handled : tuple of (float, float)
        Intervals of time [s] in which the hand does something other than push.
    remarks : tuple of str
        Remarks for the user, a line each.
    summarise : callable
        Adds the mode's measures to a summary.
    """

    config: Settings
    maps: MapParts[HapticMap]
    field: Law
    program: Program
    course: Trajectory
    user: Arm | Participant
    tank: EnergyTank
    notes: Notes
    gains: FigureGains
    argument_at: Callable[[Array, Array], Array]
    bends: bool = False
    held_seconds: float = 0.0
    cross_track: Array | None = None
    walking: Walking | None = None
    handled: tuple[tuple[float, float], ...] = ()
    remarks: tuple[str, ...] = ()
    summarise: Callable[[RunSummary, Measuring], RunSummary] = lambda summary, of: summary

    @property
    def begins_in_motion(self) -> bool:
        """Whether stylus and figure move when the run begins."""
        return self.maps.moves and not self.bends
