"""Trial before a run: whether the physical figure follows changes between rivers that play clips of their own."""

from collections.abc import Sequence

import mujoco
import numpy as np

from controllers.easing import smooth_steps
from controllers.fields.algebra.instructions import TRACE_PHASE, TRACE_RIVER, TRACE_SIZE
from controllers.haptic_map.river_clips import RiverClips
from controllers.state import stylus_path
from experiments.config.run_config import Figure
from experiments.fitting.figure_legs import packed_legs
from experiments.fitting.verdict import FPS, tried
from models.mocap.motion.clip import Clip
from sim.reference.reference import make_reference, reference_along

_WAY = (0, 1, 2, 0, 2, 1, 0)  # order of the three rivers: each change from one to another occurs once
_STAY, _GLIDE = 5.5, 0.3  # [s] on a river, enough to pass a gate and end the transition; [s] of a change of river
_SECONDS = _STAY * len(_WAY)


def toured(made: RiverClips, part: Figure, figure: mujoco.MjModel) -> Clip:
    """The animation of a hand that moves at the rivers' pace and changes once between every two of the three rivers."""
    # The stylus filter begins at rest: its first second is dropped.
    times = np.arange(round((_SECONDS + 2.0) * FPS)) / FPS - 1.0
    stay = np.clip(times // _STAY, 0, len(_WAY) - 1).astype(int)
    way = np.array(_WAY)
    share = smooth_steps((times - _STAY * stay) / _GLIDE)[:, None]
    phases = np.array([curve.start + times % curve.duration for curve in made.curves])
    points = np.array([curve.point(phase) for curve, phase in zip(made.curves, phases, strict=True)])
    rows = np.arange(len(times))
    now, before = points[way[stay], rows], points[way[np.maximum(stay - 1, 0)], rows]
    traces, poses = np.zeros((len(times), TRACE_SIZE)), np.empty((len(times), made.nq))
    traces[:, TRACE_RIVER], traces[:, TRACE_PHASE] = way[stay], phases[way[stay], rows]
    reference = make_reference(figure, made.compiled(), 1.0 / FPS, part.smoothing, part.blend, packed_legs(figure))
    reference_along(reference, stylus_path(before + share * (now - before)), traces, poses)
    return Clip(poses[times >= 0.0], FPS, "rivers")


def not_followed(made: RiverClips, names: Sequence[str], part: Figure, figure: mujoco.MjModel) -> tuple[str, ...]:
    """Remark on a map of three rivers, if the physical figure does not follow it; needs compiled code.

    Parameters
    ----------
    made : RiverClips
        The map.
    names : sequence of str
        Names of the rivers' clips.
    part : Figure
        Settings of the figure; of these, the stylus filter and the duration of transitions are used.
    figure : mujoco.MjModel
        Model of the figure alone.
    """
    made_of = (made.compiled().params, np.array([part.smoothing, part.blend]))
    verdict = tried(__name__, lambda: toured(made, part, figure), _SECONDS, made_of)
    if verdict.bearable:
        return ()
    stay = min(int(verdict.fell // _STAY), len(_WAY) - 1) if verdict.falls else 0
    after = f", {verdict.fell - _STAY * stay:.1f} s after {names[_WAY[stay - 1]]} gives way to {names[_WAY[stay]]}"
    where = after if stay else ", before any river changes" if verdict.falls else ""
    return (f"from river to river the physical figure {verdict}{where}",)
