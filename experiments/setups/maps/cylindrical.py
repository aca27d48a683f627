"""Set-up of the cylindrical map: four clips at the corners of a hollow cylinder's cross-section."""

from dataclasses import replace

import mujoco
import numpy as np

from controllers.blending.clip_arrays import clip_arrays
from controllers.haptic_map.cylindrical import Cylindrical as CylindricalMap
from controllers.haptic_map.cylindrical import LegsOfOneClip, correction_shape
from controllers.legs.limbs import Limb
from experiments.files.array_cache import cached_array
from experiments.fitting.balance import with_balance
from experiments.fitting.blendable import all_same, going_round
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.leg_choice import select_legs, single_clip_remarks
from experiments.fitting.similarity import arms, moves_alike
from experiments.fitting.suitable_laps import pace_mismatch, timing_clip
from experiments.setups.maps.about_circle import Place, about_circle, motions_of, out_of_step, played_clips
from experiments.setups.parts.part_types import ClipMapParts
from geometry.arrays import Array
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip

CORNERS = 4  # number of clips


def cylindrical_parts(clips: tuple[Clip, ...], figure: mujoco.MjModel, place: Place, parallel: bool) -> ClipMapParts:
    """Map parts of four clips at the corners of a hollow cylinder's cross-section (r, z); fewer clips are repeated.

    `parallel` says whether the field keeps the pace of a hand that is pushed off its curve.

    Raises
    ------
    ControllerError
        If there are no clips, or more than four, or they do not fit together.
    """
    played, reach = played_clips(clips, CORNERS, "cylindrical"), place.reach
    motions, radii, legs, lap = motions_of(played), place.radii(), figure_legs(figure), place.curve.duration
    timing = timing_clip(clips)

    def with_legs_of(owner: int) -> CylindricalMap:
        own = LegsOfOneClip(owner, arms(legs), played[owner].name)
        return CylindricalMap(motions, radii, (-reach, reach), legs, None, lap, own)

    def choose_legs() -> tuple[CylindricalMap, tuple[str, ...]]:
        return select_legs(with_legs_of, [clip.name for clip in clips], lap, parallel)

    if out_of_step(played, lap):
        parts = about_circle(place, with_legs_of(timing), clips, timing)
        return replace(parts, refined=choose_legs).with_remarks(going_round(clips, legs))
    haptic_map = _cached_map(motions, radii, (-reach, reach), legs, lap)

    def refined() -> tuple[CylindricalMap, tuple[str, ...]]:
        if all_same(clips):
            balanced_map = with_balance(haptic_map, figure, lap)
            # An open clip is played forth and back. Backwards it needs the same forces, but is followed less well.
            keeps_pace = pace_mismatch(clips[:1], haptic_map.loops[:1], lap) == 0.0
            as_prepared = clips[0].closes(CLOSURE_TOLERANCE) and keeps_pace
            return balanced_map, () if as_prepared else single_clip_remarks(balanced_map, clips[0].name, lap, parallel)
        return (with_balance(haptic_map, figure, lap), ()) if moves_alike(haptic_map, lap) else choose_legs()

    return replace(about_circle(place, haptic_map, clips, timing), refined=refined).with_remarks(
        going_round(clips, legs)
    )


def _cached_map(
    clips: list[tuple[Array, float]], radii: tuple[float, float], heights: tuple[float, float], legs: tuple[Limb, ...],
    lap: float,
) -> CylindricalMap:  # fmt: skip
    """The map of four clips; its corrections are cached beside the compiled code."""

    def find() -> Array:
        return CylindricalMap(clips, radii, heights, legs, None, lap).corrections

    # The corrections do not depend on the radii and heights between which the clips blend.
    made_of = (*clip_arrays(clips, range(len(clips)), legs).values(), np.array([lap]))
    shape = (-1, *correction_shape(len(legs)))
    corrections = cached_array(CylindricalMap.__module__, "corrections", made_of, shape, find)
    return CylindricalMap(clips, radii, heights, legs, corrections, lap)
