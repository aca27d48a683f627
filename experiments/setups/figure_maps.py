"""Map parts by kind of map: cylindrical, composite, rivers' clips, and maps from files."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import mujoco
import numpy as np

from controllers.blending.clip_arrays import clip_arrays
from controllers.curves.cylinder import AXIS
from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.haptic_map.animation import AnimationMap, ClipMap
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.composite import Composite as CompositeMap
from controllers.haptic_map.cylindrical import Cylindrical as CylindricalMap
from controllers.haptic_map.cylindrical import correction_shape
from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.river_clips import RiverClips as RiverClipsMap
from controllers.legs.limbs import Limb
from controllers.motion.strides import in_step
from controllers.state import Array
from experiments.config.maps import Circle, Composite, Cylindrical, MapFile, RiverClips
from experiments.config.modes import Follow, Rivers
from experiments.config.run_config import RunConfig
from experiments.files.array_cache import kept_array
from experiments.files.map_files import load_figure_map, map_digest
from experiments.fitting.balance import balanced
from experiments.fitting.blendable import (
    closed_loops,
    furthest_off,
    grounded,
    keep_own_pace,
    keeps_pace,
    longest_flight,
    not_blendable,
    off_pace,
    same,
)
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.leg_choice import carried, unbearable
from experiments.fitting.push_trials import followed_map
from experiments.fitting.rest_phases import with_rests
from experiments.fitting.river_changes import with_changes
from experiments.fitting.river_tour import not_followed
from experiments.fitting.similarity import arms, carries_alike, moves_alike, upper_joints
from experiments.fitting.transition_places import carried_over
from experiments.setups.modes.lifted_runs import (
    HELD_GAINS,
    best_transition,
    curve_number,
    default_pushes,
    lifted_choice,
    lifted_curve,
)
from experiments.setups.modes.rivers import default_choice, river_bundle
from experiments.setups.parts.hands import river_pushes
from experiments.setups.parts.pace import course_of, reached
from experiments.setups.parts.part_types import ClipMapParts
from models.humanoid.skeleton import DEFAULT_STATURE, N_POSE, figure_model, proportion
from models.mocap.motion.clip import CLOSES, Clip
from sim.compilation.sources import kept_folder

AnyMap = Cylindrical | Composite | RiverClips | MapFile

CORNERS, PARTS = 4, 3  # clips of a cylindrical and of a composite map
_COMPARED = 5  # places of a lap at which a user-defined derivative is compared: few symmetries of a map have all five
_MOST_LAPS = 4  # in a round: with more, a hand waits long for a change, and there are many changes to compute
LIFTED_CARRY = 0.3  # factor on the default hand's distances on a lifted map, whose curves are near each other


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


def for_size_of(figure: mujoco.MjModel, made: Callable[[mujoco.MjModel], ClipMapParts]) -> ClipMapParts:
    """Map parts of a figure of any stature: made for the default one, whose motions clips are, and in proportion to it.

    Lengths in proportion s at the same times scale accelerations by s, and gravity stays: a flight of the scaled motion
    is ballistic at 1/√s of its own pace (equal Froude number, Alexander 1989, *Optimization and gaits in the locomotion
    of vertebrates*, Physiol. Rev. 69, 1199-1227).
    """
    size = proportion(figure)
    if size == 1.0:
        return made(figure)
    parts = made(figure_model())
    flying = [clip.name for clip in parts.clips if longest_flight(clip) > 0.0]
    falls = (
        f"the flights of {', '.join(dict.fromkeys(flying))} last as they do at {DEFAULT_STATURE:g} m of stature; "
        f"a figure of {DEFAULT_STATURE * size:.2f} m falls so at {size**-0.5:.2f} of the clips' own pace"
    )
    return replace(parts, size=size, remarks=parts.remarks + ((falls,) if flying else ()))


def cylindrical_parts(
    clips: tuple[Clip, ...], place: Place, figure: mujoco.MjModel, parallel: bool = False
) -> ClipMapParts:
    """Map parts of four clips at the corners of a hollow cylinder's cross-section (r, z); fewer clips are repeated.

    `parallel` says whether the field keeps the pace of a hand that is pushed off its curve.

    Raises
    ------
    ControllerError
        If there are none, or more than four, or they do not fit together.
    """
    motions, reach = _motions(clips, CORNERS, "cylindrical"), place.reach
    radii, legs, lap = place.radii(), figure_legs(figure), place.curve.duration

    def with_legs_of(owner: int) -> CylindricalMap:
        return CylindricalMap(motions, radii, (-reach, reach), legs, None, lap, arms(legs), owner)

    def carrying() -> tuple[CylindricalMap, tuple[str, ...]]:
        return carried(with_legs_of, [clip.name for clip in clips], lap, parallel)

    if _out_of_step(clips, len(motions), lap):
        return replace(_about_circle(place, with_legs_of(grounded(clips)), clips), refined=carrying)
    made = _cylinder(motions, radii, (-reach, reach), legs, lap)

    def refined() -> tuple[CylindricalMap, tuple[str, ...]]:
        if same(clips):
            alone = balanced(made, figure, lap)
            # An open clip is played there and back. Backwards it needs the same forces, but is followed less well.
            as_prepared = clips[0].closes(CLOSES) and keep_own_pace(clips[:1], made.loops[:1], lap)
            return alone, () if as_prepared else unbearable(alone, clips[0].name, lap, parallel)
        return (balanced(made, figure, lap), ()) if moves_alike(made, lap) else carrying()

    return replace(_about_circle(place, made, clips), refined=refined)


def composite_parts(
    clips: tuple[Clip, ...], place: Place, figure: mujoco.MjModel, parallel: bool = False
) -> ClipMapParts:
    """Map parts of the lower body of one clip and an upper body blended between two more; fewer clips are repeated.

    `parallel` is as for a cylinder.

    Raises
    ------
    ControllerError
        If there are none, or more than three, or they do not fit together.
    """
    lower, red, blue = _motions(clips, PARTS, "composite")
    legs, radii = figure_legs(figure), place.radii()
    lap = place.curve.duration
    apart = _out_of_step(clips, 3, lap)
    made = CompositeMap(lower, red, blue, upper_joints(legs), radii, legs, lap, apart)

    def refined() -> tuple[CompositeMap, tuple[str, ...]]:
        if carries_alike(made, lap):
            return made, ()
        only = CompositeMap(lower, red, blue, arms(legs), radii, legs, lap, apart)
        return carried(lambda _: only, [clips[0].name], lap, parallel)

    return replace(_about_circle(place, made, clips, timing=0), refined=refined)


def lifted_parts(made: Lifted, clips: tuple[Clip, ...], part: MapFile) -> ClipMapParts:
    """Map parts of a lifted map, beginning on one of its curves.

    Raises
    ------
    ParameterError
        If the map has no curve of that name.
    SimError
        If the Phantom does not reach it.
    """
    curve = lifted_curve(made, part.curve)
    ends = (
        f"the clip is open: the hand, and with it the figure, is held at its curve's end after {curve.duration:.1f} s"
    )
    between = not_blendable(clips)
    return ClipMapParts(
        haptic_map=made, clips=clips, curve=curve, lap_seconds=curve.duration, reach=part.reach,
        rivers=lambda mode: lifted_choice(made, mode),
        river_pushes=lambda mode, seconds: default_pushes(made, part.curve, mode),
        course=cache(partial(course_of, curve)),
        expressive=part.expressive, gains=HELD_GAINS, moves=True, carry=LIFTED_CARRY, held_seconds=curve.duration,
        remarks=between if curve.periodic else (ends, *between),
    )  # fmt: skip


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

    haptic_map.check_jacobian(curve.point(np.linspace(curve.start, curve.end, _COMPARED, endpoint=False)))

    def none(*_: object) -> Any:
        raise ParameterError("a map of one's own has no rivers; expected another field")

    return ClipMapParts(
        haptic_map=cast(ClipMap, haptic_map), clips=(), curve=reached(curve), reach=Circle().radius, rivers=none,
        river_pushes=none, course=lambda damping, stiffness: curve,
    )  # fmt: skip


def _flows_parallel(config: RunConfig) -> bool:
    return isinstance(config.mode, Follow) and config.mode.flow == "parallel"


def _cylindrical(config: RunConfig, part: Cylindrical, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> ClipMapParts:
    return cylindrical_parts(clips, _place(part), figure, _flows_parallel(config))


def _composite(config: RunConfig, part: Composite, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> ClipMapParts:
    return composite_parts(clips, _place(part), figure, _flows_parallel(config))


def _river_clips_parts(
    config: RunConfig, part: RiverClips, clips: tuple[Clip, ...], figure: mujoco.MjModel
) -> ClipMapParts:
    mode = config.mode
    if not isinstance(mode, Rivers) or mode.crossing == "sum":
        raise ParameterError("the rivers' map needs --mode rivers, and a --crossing that gives the hand to one river")
    motions, place = _motions(clips, 3, part.kind), _place(part)
    curves = [river.curve for river in river_bundle(place.curve, part.reach, 1.0, 1.0, mode.river_tube).rivers]
    laps, apart = _round(clips, 3, place.curve.duration)
    made = RiverClipsMap(
        curves, motions, mode.river_tube, figure_legs(figure), laps * place.curve.duration, apart, laps
    )  # fmt: skip
    parts, names = _about_circle(place, made, clips), [clips[i % len(clips)].name for i in range(3)]

    def refined() -> tuple[RiverClipsMap, tuple[str, ...]]:
        ready = with_rests(made, figure)
        if config.figure.kind != "physical" or same(clips):
            return ready, ()
        changing = with_changes(ready, config.figure.blend, figure)
        return changing, not_followed(changing, names, config.figure, figure)

    told = f"a round of the clips takes {laps} laps of the hand, so that each keeps its pace"
    return replace(parts.with_remarks((told,)) if laps > 1 else parts, plays_rivers=True, refined=refined)


def _file_parts(config: RunConfig, part: MapFile, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> ClipMapParts:
    path = Path(part.file)
    made, clips = load_figure_map(path)
    if isinstance(made, Lifted):
        if part.around != Circle():
            raise ParameterError("a lifted map has curves of its own, timed by its clips; leave out --lap and --radius")
        parts = lifted_parts(made, clips, part)
        pushed = config.user.does == "push" and config.figure.kind == "physical"
        if pushed and isinstance(config.mode, Rivers) and not config.user.pushes:
            parts = replace(parts, refined=partial(carried_over, made, best_transition(made, part.curve)))
        elif pushed and not isinstance(config.mode, Rivers):
            number = curve_number(made, part.curve)
            followed = partial(followed_map, made, parts.curve, number, arms(made.limbs), _flows_parallel(config))
            parts = replace(parts, refined=followed)
    elif part.curve:
        raise ParameterError("only a lifted map has curves by name; leave out --curve, or name a lifted map")
    else:
        parts = _about_circle(_place(part), made, clips)
    remark = f"the clips are those of the map: {', '.join(made.names)}"
    return replace(parts.with_remarks((remark,)), static={"map_sha256": map_digest(path)})


MAP_SETUPS: dict[str, Callable[..., ClipMapParts]] = {
    "cylindrical": _cylindrical,
    "composite": _composite,
    "rivers": _river_clips_parts,
    "file": _file_parts,
}
"""Functions that make the map's parts, by kind of map."""


def _about_circle(
    place: Place, made: AnimationMap, clips: tuple[Clip, ...], timing: int | None = None
) -> ClipMapParts:  # fmt: skip
    curve, reach = place.curve, place.reach
    played = [clips[i % len(clips)] for i in range(len(made.loops))]
    off = off_pace(played, made.loops, curve.duration, made.laps, grounded(clips) if timing is None else timing)
    return ClipMapParts(
        haptic_map=made, clips=clips, curve=curve, lap_seconds=made.lap_seconds, reach=reach,
        rivers=lambda mode: default_choice(mode, curve, reach),
        river_pushes=lambda mode, seconds: river_pushes(curve, seconds),
        course=cache(partial(course_of, curve)), moves=True, expressive=place.expressive,
        held_seconds=made.lap_seconds, remarks=(*not_blendable(clips), *off),
    )  # fmt: skip


def check_clips(clips: Sequence[Clip], most: int, name: str) -> None:
    """Refuse more clips than a map takes, or none.

    Raises
    ------
    ParameterError
        The map, and how many it takes.
    """
    if not 1 <= len(clips) <= most:
        raise ParameterError(f"the {name} map takes 1 to {most} clips, got {len(clips)}; expected so many --clips")


def _motions(clips: tuple[Clip, ...], most: int, name: str) -> list[tuple[Array, float]]:
    """Poses and frame rates of as many motions as a map takes; if there are fewer clips, they are repeated."""
    check_clips(clips, most, name)
    return [(clips[i % len(clips)].poses, clips[i % len(clips)].fps) for i in range(most)]


def _out_of_step(clips: tuple[Clip, ...], count: int, lap: float) -> bool:
    """Whether a lap [s] with all clips in step would play some of them too far from their own pace.

    `count` is the number of clips that the map takes; if there are fewer, they are repeated.
    """
    played = [clips[i % len(clips)] for i in range(count)]
    return not same(clips) and not keeps_pace(played, in_step(closed_loops(played), lap), lap)


def _round(clips: tuple[Clip, ...], count: int, lap: float) -> tuple[int, bool]:
    """Laps in a round of clips on `count` rivers, and whether strides are apart: the fewest laps that keep their pace.

    If none do, the laps in which the clip furthest from its own pace is nearest to it.
    """
    if same(clips):
        return 1, False
    played, best = [clips[i % len(clips)] for i in range(count)], (np.inf, 1, True)
    loops = closed_loops(played)
    for laps in range(1, _MOST_LAPS + 1):
        for apart in (False, True):
            fitted = in_step(loops, laps * lap, apart)
            if keep_own_pace(played, fitted, laps * lap):
                return laps, apart
            best = min(best, (furthest_off(fitted, laps * lap), laps, apart))
    return best[1:]


def _place(part: AnyMap) -> Place:
    around = part.around
    curve = reached(Trajectory.circle(around.radius, around.lap, wave=around.wave))
    return Place(curve, around.radius, part.reach, part.expressive)


def _cylinder(
    clips: list[tuple[Array, float]], radii: tuple[float, float], heights: tuple[float, float], legs: tuple[Limb, ...],
    lap: float,
) -> CylindricalMap:  # fmt: skip
    """The map of four clips; its corrections are cached beside the compiled code."""

    def find() -> Array:
        return CylindricalMap(clips, radii, heights, legs, None, lap).corrections

    # The corrections do not depend on the radii and heights between which the clips blend.
    made_of = (*clip_arrays(clips, [str(i) for i in range(len(clips))], legs).values(), np.array([lap]))
    folder = kept_folder(CylindricalMap.__module__)
    corrections = kept_array(folder, "corrections", made_of, (-1, *correction_shape(len(legs))), find)
    return CylindricalMap(clips, radii, heights, legs, corrections, lap)
