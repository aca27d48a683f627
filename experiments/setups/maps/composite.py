"""Set-up of the red-blue composite: the lower body of one clip, and an upper body blended between two more."""

from dataclasses import replace

import mujoco

from controllers.haptic_map.composite import Composite as CompositeMap
from experiments.fitting.blendable import going_round
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.leg_choice import select_legs
from experiments.fitting.similarity import arms, carries_alike, upper_joints
from experiments.setups.maps.about_circle import Place, about_circle, motions_of, out_of_step, played_clips
from experiments.setups.parts.part_types import ClipMapParts
from models.mocap.motion.clip import Clip

PARTS = 3  # number of clips


def composite_parts(clips: tuple[Clip, ...], figure: mujoco.MjModel, place: Place, parallel: bool) -> ClipMapParts:
    """Map parts of the lower body of one clip and an upper body blended between two more; fewer clips are repeated.

    `parallel` is as in `cylindrical_parts`.

    Raises
    ------
    ControllerError
        If there are no clips, or more than three, or they do not fit together.
    """
    played = played_clips(clips, PARTS, "composite")
    lower, red, blue = motions_of(played)
    legs, radii = figure_legs(figure), place.radii()
    lap = place.curve.duration
    apart = out_of_step(played, lap)
    haptic_map = CompositeMap(lower, red, blue, upper_joints(legs), radii, legs, lap, apart)

    def refined() -> tuple[CompositeMap, tuple[str, ...]]:
        if carries_alike(haptic_map, lap):
            return haptic_map, ()
        only = CompositeMap(lower, red, blue, arms(legs), radii, legs, lap, apart)
        return select_legs(lambda _: only, [clips[0].name], lap, parallel)

    parts = about_circle(place, haptic_map, clips, timing=0)
    return replace(parts, refined=refined).with_remarks(going_round(clips, legs))
