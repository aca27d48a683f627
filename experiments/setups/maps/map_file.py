"""Set-up of lifted maps, which come from files."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco

from controllers.errors import ParameterError
from controllers.haptic_map.lifted import Lifted
from experiments.config.maps import Circle, MapFile
from experiments.config.modes import Rivers
from experiments.config.run_config import RunConfig
from experiments.files.map_files import load_figure_map, map_digest
from experiments.fitting.blendable import not_blendable
from experiments.fitting.leg_choice import followed_map
from experiments.fitting.similarity import arms
from experiments.setups.modes.follow import flows_parallel
from experiments.setups.modes.lifted_runs import (
    HELD_GAINS,
    best_transition,
    carried_over,
    curve_number,
    default_pushes,
    lifted_choice,
    lifted_curve,
)
from experiments.setups.parts.lap import DEFAULT_LAP
from experiments.setups.parts.part_types import ClipMapParts
from models.mocap.motion.clip import Clip

LIFTED_CARRY = 0.3  # factor on the default hand's distances on a lifted map, whose curves are near each other


def map_file_setup(config: RunConfig, part: MapFile, clips: tuple[Clip, ...], figure: mujoco.MjModel) -> ClipMapParts:
    """Map parts of the lifted map in a file.

    Raises
    ------
    ControllerError, ModelError, SimError
        If the file cannot be read, or has no such curve, or a lap or a radius is given.
    """
    path = Path(part.file)
    haptic_map, clips = load_figure_map(path)
    if part.around not in (Circle(), Circle(lap=DEFAULT_LAP)):
        raise ParameterError("a lifted map has curves of its own, timed by its clips; leave out --lap and --radius")
    parts = lifted_parts(haptic_map, clips, part)
    pushed = config.user.does == "push" and config.figure.kind == "physical"
    if pushed and isinstance(config.mode, Rivers) and not config.user.pushes:
        parts = replace(parts, refined=partial(carried_over, haptic_map, best_transition(haptic_map, part.curve)))
    elif pushed and not isinstance(config.mode, Rivers):
        parts = fitted_to_pushes(haptic_map, parts, part.curve, flows_parallel(config))
    remark = f"the clips are those of the map: {', '.join(haptic_map.names)}"
    return replace(parts.with_remarks((remark,)), static={"map_sha256": map_digest(path)})


def fitted_to_pushes(haptic_map: Lifted, parts: ClipMapParts, curve: str, keeps_pace: bool) -> ClipMapParts:
    """The parts with as much of the map as the physical figure follows when pushed off a curve (`followed_map`)."""
    number = curve_number(haptic_map, curve)
    followed = partial(followed_map, haptic_map, parts.curve, number, arms(haptic_map.limbs), keeps_pace)
    return replace(parts, refined=followed)


def lifted_parts(haptic_map: Lifted, clips: tuple[Clip, ...], part: MapFile) -> ClipMapParts:
    """Map parts of a lifted map, beginning on one of its curves.

    Raises
    ------
    ParameterError
        If the map has no curve of that name.
    SimError
        If the Phantom does not reach it.
    """
    curve = lifted_curve(haptic_map, part.curve)
    ends = (
        f"the clip is open: the hand, and with it the figure, is held at its curve's end after {curve.duration:.1f} s"
    )
    between = not_blendable(clips)
    return ClipMapParts(
        haptic_map=haptic_map, clips=clips, curve=curve, reach=part.reach,
        rivers=lambda mode: lifted_choice(haptic_map, mode),
        river_pushes=lambda mode, seconds: default_pushes(haptic_map, part.curve, mode),
        expressive=part.expressive, gains=HELD_GAINS, moves=True, carry=LIFTED_CARRY,
        curve_clip_seconds=curve.duration,
        remarks=between if curve.periodic else (ends, *between),
    )  # fmt: skip
