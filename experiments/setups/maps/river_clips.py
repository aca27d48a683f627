"""Set-up of the rivers' map: a clip on each river, in rounds of one or more laps of the hand."""

from dataclasses import replace

import mujoco
import numpy as np

from controllers.errors import ParameterError
from controllers.haptic_map.river_clips import RiverClips as RiverClipsMap
from experiments.config.maps import RiverClips
from experiments.config.modes import Rivers
from experiments.config.run_config import RunConfig
from experiments.fitting.blendable import all_same
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.hand_tours import river_remarks
from experiments.fitting.rest_phases import with_rests
from experiments.fitting.river_changes import with_changes
from experiments.fitting.suitable_laps import MAX_LAPS, fit_round
from experiments.setups.maps.about_circle import about_circle, motions_of, place_of, played_clips
from experiments.setups.modes.rivers import river_bundle
from experiments.setups.parts.part_types import ClipMapParts
from models.mocap.motion.clip import Clip

_RIVER_COUNT = 3  # rivers about a circle (`river_bundle`), each with a clip


def river_clips_setup(
    config: RunConfig, part: RiverClips, clips: tuple[Clip, ...], figure: mujoco.MjModel
) -> ClipMapParts:
    """Map parts of clips on rivers; fewer than three clips are repeated.

    Raises
    ------
    ControllerError
        If the mode has no river for each clip, or the clips do not fit together.
    """
    mode = config.mode
    if not isinstance(mode, Rivers) or mode.crossing == "sum":
        raise ParameterError("the rivers' map needs --mode rivers, and a --crossing that gives the hand to one river")
    played, place = played_clips(clips, _RIVER_COUNT, part.kind), place_of(part)
    curves = [river.curve for river in river_bundle(place.curve, part.reach, 1.0, 1.0, mode.river_tube).rivers]
    lap = place.curve.duration
    seconds, apart = fit_round(played, lap * np.arange(1.0, 2 if all_same(played) else MAX_LAPS + 1))
    laps = round(seconds / lap)
    haptic_map = RiverClipsMap(
        curves, motions_of(played), mode.river_tube, figure_legs(figure), seconds, apart, laps
    )  # fmt: skip
    parts = about_circle(place, haptic_map, clips, timing=None)

    def refined() -> tuple[RiverClipsMap, tuple[str, ...]]:
        ready = with_rests(haptic_map, figure)
        if config.figure.kind != "physical" or all_same(clips):
            return ready, ()
        changing = with_changes(ready, config.figure.blend, figure)
        return changing, river_remarks(changing, [clip.name for clip in played], config.figure, figure)

    remark = f"a round of the clips takes {laps} laps of the hand, so that each keeps its speed"
    return replace(parts.with_remarks((remark,)) if laps > 1 else parts, plays_rivers=True, refined=refined)
