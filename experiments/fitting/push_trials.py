"""Trials before a run: how much of a lifted map the physical figure follows when its hand is pushed off its curve.

Curves lie some 10 mm apart, and 2.5 N push a hand by 8: at any moment of the lap, not only where motions agree, and
within 0.15 s. Where the figure does not follow the whole map, or feet skate on it, its legs and trunk stay with the
curve's own clip, and it carries as large a share of the others' arms as it can, as on the cylinder
(`experiments.fitting.leg_choice`).
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.lifted import Lifted
from controllers.state import Array, stylus_path
from experiments.fitting.leg_choice import EVERY, SHARES, WELL, is_sound, push_profile
from experiments.fitting.verdict import FPS, SECONDS, Verdict, tried
from models.mocap.motion.clip import Clip
from sim.reference.reference import map_poses

_PUSHED = 8e-3  # [m] offset by a push: 2.5 N against 300 N/m


def toured(made: Lifted, curve: Trajectory, keeps_pace: bool) -> Clip:
    """The animation of a hand that moves along a curve of a map at its pace and is pushed outwards and inwards.

    Where the field does not keep its pace there (`Follow.parallel`), a push leaves the hand's speed as it is, so its
    angular speed is lower the further out it is.
    """
    times = np.arange(round((SECONDS + 1.0) * FPS)) / FPS
    pushed = _PUSHED * push_profile(np.maximum(times - EVERY, 0.0))
    since = times if keeps_pace else _slowed(curve, pushed)
    phases = since % curve.duration if curve.periodic else np.minimum(since, curve.duration)
    points = curve.point(curve.start + phases)
    points[:, :2] *= 1.0 + (pushed / np.hypot(points[:, 0], points[:, 1]))[:, None]
    return Clip(map_poses(made, stylus_path(points)), FPS, "pushed")


def _slowed(curve: Trajectory, pushed: Array) -> Array:
    """Phase since the curve's start [s] of a hand off the curve by `pushed` [m], at the speed that it has on it."""
    since = np.zeros(len(pushed))
    for k, off in enumerate(pushed[:-1]):
        at = since[k] % curve.duration if curve.periodic else min(since[k], curve.duration)
        radius = float(np.hypot(*curve.point(curve.start + at)[:2]))
        since[k + 1] = since[k] + radius / (radius + off) / FPS
    return since


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
        Its clip, whose legs the figure keeps where it does not follow the whole map.
    arms : sequence of int
        Joints that are then still blended, counted from 1.
    keeps_pace : bool
        Whether the field keeps the pace of a hand that is pushed off (`Follow.parallel`).
    """

    def made_of(part: Lifted) -> tuple[npt.NDArray[np.generic], ...]:
        return part.compiled().params, np.asarray(curve.times), np.asarray(curve.positions), np.array([keeps_pace])

    def verdict_on(part: Lifted) -> Verdict:
        return tried(__name__, lambda: toured(part, curve, keeps_pace), SECONDS, made_of(part))

    whole = verdict_on(made)
    sound = not whole.bearable or is_sound(__name__, lambda: toured(made, curve, keeps_pace), made_of(made))
    if whole.bearable and sound:
        return made, ()
    best, found = (made, whole) if sound else (made, Verdict(np.inf, 0.0))
    for share in SHARES:
        part = made.with_legs_of(clip, arms, share)
        verdict = verdict_on(part)
        if verdict.worse() < found.worse():
            best, found = part, verdict
        if found.bearable and found.residual <= WELL:
            break
    fault = f"the physical figure {whole}" if sound else "the animation's feet skate or sink, or joints go too far,"
    told = f"pushed off its curve to those beside it, {fault} with the whole map"
    return best, (told if found.bearable else f"{told}, and {found} with what it bears best",)
