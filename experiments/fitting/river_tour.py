"""Trial before a run: whether the physical figure follows changes between rivers that each play their own clip."""

from collections.abc import Sequence

import mujoco
import numpy as np

from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from controllers.state import stylus_path
from experiments.config.run_config import Figure
from experiments.fitting.figure_legs import packed_legs
from experiments.fitting.verdict import FPS, Trial
from geometry.easing import smooth_steps
from models.mocap.motion.clip import Clip
from sim.reference.reference import make_reference, reference_along

_ORDER = (0, 1, 2, 0, 2, 1, 0)  # of the three rivers: each change from one to another occurs once
_DWELL_TIME, _TRANSFER_TIME = 5.5, 0.3  # [s] on a river, enough for a gate and the transition; [s] to the next river
_DURATION = _DWELL_TIME * len(_ORDER)


def tour_clip(haptic_map: RiverClips, part: Figure, figure: mujoco.MjModel) -> Clip:
    """The animation of a hand that moves at the rivers' pace and makes each change between two of the rivers once."""
    # The stylus filter begins at rest: its first second is dropped.
    times = np.arange(round((_DURATION + 2.0) * FPS)) / FPS - 1.0
    stop = np.clip(times // _DWELL_TIME, 0, len(_ORDER) - 1).astype(int)
    order = np.array(_ORDER)
    share = smooth_steps((times - _DWELL_TIME * stop) / _TRANSFER_TIME)[:, None]
    phases = np.array([curve.start + times % curve.duration for curve in haptic_map.curves])
    points = np.array([curve.point(phase) for curve, phase in zip(haptic_map.curves, phases, strict=True)])
    rows = np.arange(len(times))
    current, previous = points[order[stop], rows], points[order[np.maximum(stop - 1, 0)], rows]
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), haptic_map.nq))
    traces[:, TRACE_RIVER], traces[:, TRACE_PHASE] = order[stop], phases[order[stop], rows]
    reference = make_reference(
        figure, haptic_map.compiled(), 1.0 / FPS, part.smoothing, part.blend, packed_legs(figure)
    )
    reference_along(reference, stylus_path(previous + share * (current - previous)), traces, poses)
    return Clip(poses[times >= 0.0], FPS, "rivers")


def tour_remarks(haptic_map: RiverClips, names: Sequence[str], part: Figure, figure: mujoco.MjModel) -> tuple[str, ...]:
    """Remark on a map of three rivers, if the physical figure does not follow it; needs compiled code.

    Parameters
    ----------
    haptic_map : RiverClips
        The map.
    names : sequence of str
        Names of the rivers' clips.
    part : Figure
        Settings of the figure; of these, the stylus filter and the duration of transitions are used.
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    made_of = (haptic_map.compiled().params, np.array([part.smoothing, part.blend]))
    verdict = Trial(__name__, lambda: tour_clip(haptic_map, part, figure), _DURATION, made_of).verdict()
    if verdict.acceptable:
        return ()
    stop = min(int(verdict.fell // _DWELL_TIME), len(_ORDER) - 1) if verdict.falls else 0
    change = f"the change from {names[_ORDER[stop - 1]]} to {names[_ORDER[stop]]}"
    after = f", {verdict.fell - _DWELL_TIME * stop:.1f} s after {change}"
    where = after if stop else ", before any river changes" if verdict.falls else ""
    return (f"from river to river the physical figure {verdict}{where}",)
