"""Set-up of the rivers' map: a clip on each river, in rounds of one or more laps of the hand."""

from dataclasses import replace

import mujoco
import numpy as np

from controllers.errors import ParameterError
from controllers.haptic_map.river_clips import RiverClips as RiverClipsMap
from controllers.motion.strides import fit_to_lap
from experiments.config.maps import RiverClips
from experiments.config.modes import Rivers
from experiments.config.run_config import RunConfig
from experiments.fitting.blendable import all_same, closed_loops, lap_suits_each
from experiments.fitting.figure_legs import figure_legs
from experiments.fitting.hand_tours import tour_remarks
from experiments.fitting.rest_phases import with_rests
from experiments.fitting.river_changes import with_changes
from experiments.setups.maps.about_circle import about_circle, motions_of, place_of, played_clips
from experiments.setups.modes.rivers import river_bundle
from experiments.setups.parts.part_types import ClipMapParts
from models.mocap.motion.clip import Clip

_RIVER_COUNT = 3  # rivers about a circle (`river_bundle`), each with a clip
_MAX_LAPS = 4  # laps in a round: with more, a hand waits long for a transition, and there are many to compute


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
    laps, apart = _fit_round(played, place.curve.duration)
    haptic_map = RiverClipsMap(
        curves, motions_of(played), mode.river_tube, figure_legs(figure), laps * place.curve.duration, apart, laps
    )  # fmt: skip
    parts = about_circle(place, haptic_map, clips, in_rounds=True)

    def refined() -> tuple[RiverClipsMap, tuple[str, ...]]:
        ready = with_rests(haptic_map, figure)
        if config.figure.kind != "physical" or all_same(clips):
            return ready, ()
        changing = with_changes(ready, config.figure.blend, figure)
        return changing, tour_remarks(changing, [clip.name for clip in played], config.figure, figure)

    remark = f"a round of the clips takes {laps} laps of the hand, so that each keeps its speed"
    return replace(parts.with_remarks((remark,)) if laps > 1 else parts, plays_rivers=True, refined=refined)


def _fit_round(played: list[Clip], lap: float) -> tuple[int, bool]:
    """Fewest laps of a round in which the rivers' clips keep their pace, and whether their strides are apart.

    If there are none, the laps for which the largest deviation of a clip from its own pace is smallest.
    """
    if all_same(played):
        return 1, False
    loops, best = closed_loops(played), (np.inf, 1, True)
    for laps in range(1, _MAX_LAPS + 1):
        for apart in (False, True):
            fitted = fit_to_lap(loops, laps * lap, apart)
            if lap_suits_each(played, fitted, laps * lap):
                return laps, apart
            error = max(abs(float(np.log(loop.duration / (laps * lap)))) for loop in fitted)
            best = min(best, (error, laps, apart))
    return best[1:]
