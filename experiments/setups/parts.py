"""What a run is put together from: what a kind of map gives, and what a mode makes of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.fields.bundle import RiverBundle
from controllers.fields.law import Law, Program
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.safety.energy_tank import EnergyTank
from controllers.state import Array
from controllers.walking.walker import Walker
from experiments.config.modes import Rivers
from experiments.config.run_config import Clock, Figure, Phantom
from experiments.results.summary import RunSummary
from experiments.setups.expression import expressive_figure
from models.mocap.clip import Clip
from models.scene import SceneConfig
from sim.body.figure import FigureGains
from sim.recording.recording import Recording
from sim.users.arm import Arm
from sim.users.intent import Push
from sim.users.participant import Participant

Map = TypeVar("Map", bound=HapticMap, covariant=True)
Static = Mapping[str, npt.ArrayLike | str]
"""What a recording keeps beside its channels."""


class Settings(Protocol):
    """What of a run is not its field, its map or its hand."""

    @property
    def figure(self) -> Figure:
        """The figure."""
        ...

    @property
    def device(self) -> Phantom:
        """The device."""
        ...

    @property
    def clock(self) -> Clock:
        """The rates."""
        ...

    @property
    def seed(self) -> int:
        """Of where exactly the hand lets go."""
        ...

    @property
    def scene(self) -> SceneConfig:
        """Of the world."""
        ...


class RiverChoice(NamedTuple):
    """The rivers of a run, and how they are told apart.

    Attributes
    ----------
    bundle : RiverBundle
        The rivers, by name.
    given : tuple of Trajectory
        Their curves as the map has them, timed as the hand is to move.
    pace : float
        Speed by which they are told apart [m/s].
    hysteresis : float
        By which the one that has the hand is preferred, in units of the pace.
    """

    bundle: RiverBundle
    given: tuple[Trajectory, ...]
    pace: float
    hysteresis: float


@dataclass(frozen=True, kw_only=True)
class MapParts(Generic[Map]):
    """What a kind of map gives a run.

    Attributes
    ----------
    haptic_map : HapticMap
        h, of the figure.
    clips : tuple of Clip
        What it plays.
    curve : Trajectory
        Timed as the hand is to move.
    refined : callable, optional
        The map, improved by what takes compiled code to find, and what is then to be said.
    gains : FigureGains
        Of the physical figure.
    lap_seconds : float, optional
        Of the clips, on average [s], where a lap of the curve plays one.
    moves : bool
        Whether a run begins in motion: a walk at full speed cannot begin from rest.
    expressive : bool
        Whether the stylus's orientation turns the figure.
    plays_rivers : bool
        Whether every river plays a clip of its own.
    remarks : tuple of str
        What is to be said.
    static : Static
        What a recording keeps.
    """

    haptic_map: Map
    clips: tuple[Clip, ...]
    curve: Trajectory
    refined: Callable[[], tuple[Map, tuple[str, ...]]] | None = None
    gains: FigureGains = field(default_factory=FigureGains)
    lap_seconds: float | None = None
    moves: bool = False
    expressive: bool = False
    plays_rivers: bool = False
    remarks: tuple[str, ...] = ()
    static: Static = field(default_factory=dict)

    @property
    def whole_map(self) -> HapticMap:
        """The map, with gaze and lean if it has them."""
        return expressive_figure(self.haptic_map) if self.expressive else self.haptic_map

    def said(self, remarks: tuple[str, ...]) -> Self:
        """The same with more to be said, first."""
        return replace(self, remarks=remarks + self.remarks)

    def refine(self) -> Self:
        """The same with the improved map; needs compiled code."""
        if self.refined is None:
            return self
        made, told = self.refined()
        return replace(self, haptic_map=made, remarks=self.remarks + made.remarks + told)


@dataclass(frozen=True, kw_only=True)
class ClipMapParts(MapParts[ClipMap]):
    """What a map of clips along a curve gives a run.

    Attributes
    ----------
    reach : float
        Half width of the map's domain about the curve [m].
    rivers : callable
        From the mode to its rivers.
    river_pushes : callable
        From the mode and the time of the run [s] to what a hand does that pushes over into another river.
    course : callable
        From damping [N s/m] and stiffness [N/m] of a field to the curve along which it leads.
    carry : float
        Share of the default ways by which a hand bends a curve.
    held_seconds : float
        Time of the clips [s], whose flights are let down to the floor where a hand holds the figure.
    """

    reach: float
    rivers: Callable[[Rivers], RiverChoice]
    river_pushes: Callable[[Rivers, float], tuple[Push, ...]]
    course: Callable[[float, float], Trajectory]
    carry: float = 1.0
    held_seconds: float = 0.0


@dataclass(frozen=True)
class Notes:
    """What figures, replays and recordings say of a run.

    Attributes
    ----------
    title : str
        Of the page: the mode.
    tube_radius : float
        Of what is drawn about the curve [m]; 0 for nothing.
    tube_name : str
        What that is.
    distance_from : str
        What the recorded distance is from.
    hand_does : str
        What a hand that exerts a force does.
    static : Static
        What the recording keeps besides.
    """

    title: str
    tube_radius: float
    tube_name: str = "map's domain"
    distance_from: str = "the curve"
    hand_does: str = "pushes"
    static: Static = field(default_factory=dict)


class Measuring(NamedTuple):
    """What a mode measures its run from.

    Attributes
    ----------
    recording : Recording
        Of the run.
    default_poses : callable
        Gives the animation of the curve as it was given, from the start of the run on.
    handled : tuple of (float, float)
        From and until when [s] the hand does something else than push.
    memory : Array
        Of the field, at the end.
    save_curve : callable
        Keeps a curve beside the recording.
    """

    recording: Recording
    default_poses: Callable[[], Callable[[Array, Array, Array], Array]]
    handled: tuple[tuple[float, float], ...]
    memory: Array
    save_curve: Callable[[Trajectory], None]


@dataclass(frozen=True)
class Parts:
    """A run in parts, as its mode puts it together.

    Attributes
    ----------
    config : Settings
        Of figure, device and clock, with all that was left to defaults; of a configured run its `RunConfig`.
    maps : MapParts
        The map, its clips and its curve.
    field : Law
        Law of force of the mode.
    program : Program
        The field as it runs, with all that is added.
    course : Trajectory
        Along which it leads.
    user : Arm or Participant
        The hand.
    tank : EnergyTank
        What the field may inject.
    notes : Notes
        What is said of the run.
    gains : FigureGains
        Of the physical figure.
    bends : bool
        Whether the curve is bent, so that the figure begins at rest.
    held_seconds : float
        Where a hand may hold the figure in the middle of a flight, time of the clips [s].
    walker : callable, optional
        From the field's memory to the walker whose place is the map's argument; by default that is where the stylus is.
    argument_at : callable
        From nearest points (n, 3) and phases (n,) to what the default animation is evaluated at, (n, 7).
    handled : tuple of (float, float)
        From and until when [s] the hand does something else than push.
    remarks : tuple of str
        What is to be said.
    summarise : callable
        What the mode adds to a summary.
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
    walker: Callable[[Array], Walker] | None = None
    handled: tuple[tuple[float, float], ...] = ()
    remarks: tuple[str, ...] = ()
    summarise: Callable[[RunSummary, Measuring], RunSummary] = lambda summary, of: summary

    @property
    def begins_in_motion(self) -> bool:
        """Whether stylus and figure move when the run begins."""
        return self.maps.moves and not self.bends
