"""Trials before a run: how much of a lifted map the physical figure follows when its hand is pushed off its curve.

Curves lie some 10 mm apart, and a push of 2.5 N moves the hand by 8 mm within 0.15 s, at any moment of the lap and not
only where motions agree. If the figure does not follow the whole map, or its feet skate, its legs and trunk stay with
the curve's own clip, and the other clips' arms are blended in with as large a share as the figure can follow, as on the
cylinder (`experiments.fitting.leg_choice`).
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.lifted import Lifted
from controllers.state import stylus_path
from experiments.fitting.leg_choice import GOOD_RESIDUAL, PUSH_INTERVAL, SHARES, is_sound, push_profile
from experiments.fitting.verdict import FPS, SECONDS, Verdict, cached_verdict
from geometry.arrays import Array
from models.mocap.motion.clip import Clip
from sim.reference.reference import map_poses

_PUSH_OFFSET = 8e-3  # [m] offset by a push: 2.5 N against 300 N/m


def toured(made: Lifted, curve: Trajectory, keeps_pace: bool) -> Clip:
    """The animation of a hand that moves along a curve of a map at its pace and is pushed outwards and inwards.

    If the field does not keep the pace off the curve (`Follow.parallel`), a push does not change the hand's speed, so
    its angular speed is lower the further out it is.
    """
    times = np.arange(round((SECONDS + 1.0) * FPS)) / FPS
    pushed = _PUSH_OFFSET * push_profile(np.maximum(times - PUSH_INTERVAL, 0.0))
    elapsed = times if keeps_pace else _slowed_phase(curve, pushed)
    phases = elapsed % curve.duration if curve.periodic else np.minimum(elapsed, curve.duration)
    points = curve.point(curve.start + phases)
    points[:, :2] *= 1.0 + (pushed / np.hypot(points[:, 0], points[:, 1]))[:, None]
    return Clip(map_poses(made, stylus_path(points)), FPS, "pushed")


def _slowed_phase(curve: Trajectory, pushed: Array) -> Array:
    """Phase since the curve's start [s] of a hand off the curve by `pushed` [m], at the speed that it has on it."""
    elapsed = np.zeros(len(pushed))
    for k, offset in enumerate(pushed[:-1]):
        phase = elapsed[k] % curve.duration if curve.periodic else min(elapsed[k], curve.duration)
        radius = float(np.hypot(*curve.point(curve.start + phase)[:2]))
        elapsed[k + 1] = elapsed[k] + radius / (radius + offset) / FPS
    return elapsed


def followed_map(
    made: Lifted, curve: Trajectory, clip: int, arms: Sequence[int], keeps_pace: bool
) -> tuple[Lifted, tuple[str, ...]]:
    """The map, or as much of it as the physical figure follows when pushed off a curve, and remarks.

    Parameters
    ----------
    made : Lifted
        The map.
    curve : Trajectory
        The curve that the hand follows.
    clip : int
        Its clip, whose legs the figure keeps if it does not follow the whole map.
    arms : sequence of int
        Joints that are then still blended, counted from 1.
    keeps_pace : bool
        Whether the field keeps the pace of a hand that is pushed off (`Follow.parallel`).
    """

    def made_of(part: Lifted) -> tuple[npt.NDArray[np.generic], ...]:
        return part.compiled().params, np.asarray(curve.times), np.asarray(curve.positions), np.array([keeps_pace])

    def verdict_on(part: Lifted) -> Verdict:
        return cached_verdict(__name__, lambda: toured(part, curve, keeps_pace), SECONDS, made_of(part))

    whole = verdict_on(made)
    sound = not whole.bearable or is_sound(__name__, lambda: toured(made, curve, keeps_pace), made_of(made))
    if whole.bearable and sound:
        return made, ()
    best, best_verdict = (made, whole) if sound else (made, Verdict(np.inf, 0.0))
    for share in SHARES:
        part = made.with_legs_of(clip, arms, share)
        verdict = verdict_on(part)
        if verdict.worse() < best_verdict.worse():
            best, best_verdict = part, verdict
        if best_verdict.bearable and best_verdict.residual <= GOOD_RESIDUAL:
            break
    fault = f"the physical figure {whole}" if sound else "the animation's feet skate or sink, or joints go too far,"
    remark = f"pushed off its curve to those beside it, {fault} with the whole map"
    return best, (remark if best_verdict.bearable else f"{remark}, and {best_verdict} with what it bears best",)
