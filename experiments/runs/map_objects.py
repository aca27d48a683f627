"""Haptic maps as objects, from which a simulation makes the map of its figure or robot arm."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Protocol, cast

import numpy as np
from mujoco import MjModel

from controllers.checks import check_field_types
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law
from controllers.fields.follow import Follow
from controllers.haptic_map.animation import ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.lifted import Lifted as LiftedMap
from experiments.config.keywords import with_keyword_messages
from experiments.config.maps import Circle, MapFile
from experiments.files.given_path import given_path
from experiments.files.map_files import load_figure_map
from experiments.runs.short_text import short_text
from experiments.setups.maps.about_circle import Place, check_clips
from experiments.setups.maps.composite import PARTS, composite_parts
from experiments.setups.maps.cylindrical import CORNERS, cylindrical_parts
from experiments.setups.maps.map_file import fitted_to_pushes, lifted_parts
from experiments.setups.maps.robot_arm import arm_parts
from experiments.setups.modes.lifted_runs import curve_number
from experiments.setups.parts.pace import check_reach
from experiments.setups.parts.part_types import ClipMapParts
from experiments.setups.setups import for_size_of
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import Clip
from sim.world.world import World


class BodyMap(Protocol):
    """Factory of a haptic map for the body of a run; a ready `HapticMap` can be given to a `Simulation` instead."""

    def parts(self, world: World, field: Law, pushed: bool) -> ClipMapParts:
        """What the map gives a run in a field, with a hand that pushes or not."""
        ...


@dataclass(frozen=True, repr=False)
class _AboutCurve:
    """Base of maps about a curve; see `Cylindrical`."""

    most: ClassVar[int]
    """Number of clips that the map takes."""
    make_parts: ClassVar[Callable[[tuple[Clip, ...], MjModel, Place, bool], ClipMapParts]]
    """Makes the map's parts for a figure, and for a field with a parallel flow or without."""

    clips: Sequence[Clip]
    around: Trajectory = field(repr=False)
    reach: float = 0.025
    expressive: bool = False

    @with_keyword_messages()
    def __post_init__(self) -> None:
        check_field_types(self)
        if not 0.0 < self.reach < np.inf:
            raise ParameterError(f"reach is {self.reach:g}; expected more than 0 m, and finite")
        check_clips(self.clips, self.most, type(self).__name__.lower())
        self._place().radii()

    def __repr__(self) -> str:
        return short_text(self)

    def parts(self, world: World, field: Law, pushed: bool) -> ClipMapParts:
        """What the map gives a run in a field, with a hand that pushes or not."""
        parallel = any(isinstance(law, Follow) and law.parallel for law in field.program().laws)
        clips, place = tuple(self.clips), self._place()
        return for_size_of(world.body, lambda model: self.make_parts(clips, model, place, parallel))

    def _place(self) -> Place:
        curve = check_reach(self.around)
        points = curve.point(np.linspace(curve.start, curve.end, 65))
        return Place(curve, float(np.hypot(points[:, 0], points[:, 1]).mean()), self.reach, self.expressive)


@dataclass(frozen=True, repr=False)
class Cylindrical(_AboutCurve):
    """Cylindrical map: the angle sets the frame, radius and height blend four clips (the paper's Fig. 3).

    Parameters
    ----------
    clips : sequence of Clip
        Inner low, outer low, inner high, outer high; if there are fewer, they are repeated.
    around : Trajectory
        Curve about the z axis of H, in the middle of the map's domain.
    reach : float
        Half width of the domain about the curve, in radius and in height [m].
    expressive : bool
        Whether the figure's gaze and lean follow the orientation of the stylus.

    Raises
    ------
    ParameterError
        If there is no clip, or more than four, or the domain reaches the axis.
    SimError
        If the Phantom does not reach the curve.
    """

    most, make_parts = CORNERS, staticmethod(cylindrical_parts)


@dataclass(frozen=True, repr=False)
class Composite(_AboutCurve):
    """Composite map: the lower body of one clip, the upper body blended between two (the paper's Figs. 5 to 7).

    Parameters
    ----------
    clips : sequence of Clip
        Lower body, upper body inside, upper body outside; if there are fewer, they are repeated.
    around, reach, expressive
        As in `Cylindrical`.

    Raises
    ------
    ParameterError, SimError
        As `Cylindrical`, of three clips.
    """

    most, make_parts = PARTS, staticmethod(composite_parts)


@dataclass(frozen=True)
class Lifted:
    """Map that `hvf.lift` wrote: each clip lies along a curve of its own, and near several they are blended.

    Parameters
    ----------
    file : path
        The file (.npz).
    curve : str
        Name or number of the clip on whose curve the run begins; by default the first.
    expressive : bool
        As in `Cylindrical`.

    Raises
    ------
    SimError
        If the file holds no lifted map.
    ParameterError
        If the map has no such curve.
    """

    file: str | Path
    curve: str = ""
    expressive: bool = False

    @with_keyword_messages()
    def __post_init__(self) -> None:
        check_field_types(self)
        given_path("file", self.file)
        _ = self.around

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the clips, and so of the curves."""
        return self._map_and_clips[0].names

    @property
    def around(self) -> Trajectory:
        """The curve on which the run begins, timed by its clip: φ of a field that plays it."""
        haptic_map, _ = self._map_and_clips
        return haptic_map.curve(curve_number(haptic_map, self.curve))

    @property
    def clips(self) -> tuple[Clip, ...]:
        """The clips of the map."""
        return self._map_and_clips[1]

    @cached_property
    def _map_and_clips(self) -> tuple[LiftedMap, tuple[Clip, ...]]:
        return load_figure_map(Path(self.file))

    def parts(self, world: World, field: Law, pushed: bool) -> ClipMapParts:
        """What the map gives a run in a field, with a hand that pushes or not."""
        part = MapFile(file=str(self.file), curve=self.curve, expressive=self.expressive)
        follows = [law for law in field.program().laws if isinstance(law, Follow)]

        def make_parts(_: MjModel) -> ClipMapParts:
            haptic_map, clips = self._map_and_clips
            parts = lifted_parts(haptic_map, clips, part)
            fitted = pushed and world.kind == "physical" and bool(follows)
            return fitted_to_pushes(haptic_map, parts, self.curve, follows[0].parallel) if fitted else parts

        return for_size_of(world.body, make_parts)


@dataclass(frozen=True, repr=False)
class RobotArm:
    """Map to a robot arm of seven joints in the place of the figure: its tool follows the stylus.

    Parameters
    ----------
    around : Trajectory
        Curve about which the hand is led.
    reach : float
        Half width of the tube about it in which hands begin [m].
    scale : float
        Ratio of the tool's motion to the stylus's [1].

    Raises
    ------
    ParameterError
        If a number is not positive, or, at the start of a run, if the arm does not reach where it is led.
    SimError
        If the Phantom does not reach the curve.
    """

    around: Trajectory = field(repr=False)
    reach: float = 0.025
    scale: float = 1.5

    @with_keyword_messages()
    def __post_init__(self) -> None:
        check_field_types(self)
        for name, unit in (("reach", " m"), ("scale", "")):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ParameterError(f"{name} is {getattr(self, name):g}; expected more than 0{unit}, and finite")
        check_reach(self.around)

    def __repr__(self) -> str:
        return short_text(self)

    def parts(self, world: World, field: Law, pushed: bool) -> ClipMapParts:
        """What the map gives a run in a field, with a hand that pushes or not."""
        return arm_parts(world.body, self.around, self.reach, self.scale)


_N_COMPARED = 5  # phases of a lap at which a user-defined derivative is checked: few symmetries of a map share all five


def own_parts(haptic_map: HapticMap, curve: Trajectory) -> ClipMapParts:
    """Map parts of a user-defined map about a curve, without clips.

    Raises
    ------
    ParameterError
        If its poses are not poses of the figure, or its derivative is not that of its poses.
    """
    if haptic_map.nq != N_POSE:
        name = type(haptic_map).__name__
        raise ParameterError(f"poses of {name} have {haptic_map.nq} numbers; the figure's have {N_POSE}")

    haptic_map.check_jacobian(curve.point(np.linspace(curve.start, curve.end, _N_COMPARED, endpoint=False)))

    def none(*_: object) -> Any:
        raise ParameterError("a user-defined map has no rivers; expected another field")

    return ClipMapParts(
        haptic_map=cast(ClipMap, haptic_map), clips=(), curve=check_reach(curve), reach=Circle().radius, rivers=none,
        river_pushes=none,
    )  # fmt: skip
