r"""Choice of the clip whose legs and trunk the map plays if clips move too differently to be blended as a whole.

Only arms and head are then blended. A kick is balanced by the arms of its own clip, and a flight is ballistic only with
them, so simulation decides: for the legs of each clip in turn, the physical figure follows the map's animation while a
hand wanders through the whole domain and pushes. The first clip in the user's order that is followed well is taken, or
else the best one. If the figure falls with the best, or its residual is too large, the other clips' arms are blended in
with a smaller share λ, down to 0, where the clip plays alone. Legs that skate, penetrate the floor or exceed joint
ranges are tried last. If nothing is followed well enough, a remark says so.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from experiments.files.array_cache import cached_array
from experiments.fitting.similarity import MAX_FOOT_SKATE, motion_of
from experiments.fitting.verdict import FPS, MAX_RESIDUAL, SECONDS, Verdict, cached_verdict
from geometry.arrays import Array
from geometry.easing import cubic_steps
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from sim.compilation.sources import results_folder
from sim.reference.reference import map_poses

SHARES = (1.0, 0.5, 0.25, 0.0)
GOOD_RESIDUAL = MAX_RESIDUAL / 2  # [body weights] RMS residual up to which the first clip is taken at once
# Largest floor penetration [m], the bound of docs/validation/blended-motions.md, and largest excess of a joint [rad].
MAX_PENETRATION, MAX_JOINT_EXCESS = 0.01, np.deg2rad(5.0)
_PUSH_OFFSET = 0.17  # offset by a push as a share of the domain: 2.5 N against 300 N/m, over 50 mm
PUSH_INTERVAL, _PUSH_TIME = 1.7, 0.15  # [s] between pushes, and rise time of a push


Carrying = TypeVar("Carrying", Cylindrical, Composite)


def verdict_on(made: Cylindrical | Composite, lap: float, parallel: bool) -> Verdict:
    """How the physical figure follows a map about a circle for 20 s; cached, and needs compiled code."""
    made_of = (made.compiled().params, np.array([lap, parallel, *_domain(made).ravel()]))
    return cached_verdict(__name__, lambda: tour_animation(made, lap, parallel), SECONDS, made_of)


def single_clip_remarks(made: Cylindrical, name: str, lap: float, parallel: bool) -> tuple[str, ...]:
    """Remark on a map of one clip that the physical figure does not follow well enough; needs compiled code."""
    verdict = verdict_on(made, lap, parallel)
    return () if verdict.bearable else (f"the physical figure {verdict} with {name} at this lap",)


def _domain(made: Cylindrical | Composite) -> Array:
    """Intervals of r and z through which the hand moves [m], shape (2, 2)."""
    return np.array([made.r_range, made.z_range if isinstance(made, Cylindrical) else (0.0, 0.0)])


def tour_animation(made: Cylindrical | Composite, lap: float, parallel: bool) -> Clip:
    """The animation of a hand that tours the domain of a map from its middle, with pushes outwards and inwards.

    The hand wanders at constant angular speed. A push does not change the speed along the path that the field imposes,
    so a hand pushed from radius R to r goes round at R/r of its angular speed, as in FOLLOW; with a `parallel` flow
    (`Follow.parallel`) its angular speed does not change.
    """
    times = np.arange(round((SECONDS + 1.0) * FPS)) / FPS
    turn, pushed = 2.0 * np.pi * times / SECONDS, _PUSH_OFFSET * push_profile(times)
    shares = np.stack([0.5 + 0.5 * np.sin(2.0 * turn) + pushed, 0.5 + 0.5 * np.sin(3.0 * turn)])
    low, high = _domain(made).T
    r, z = low[:, None] + np.clip(shares, 0.0, 1.0) * (high - low)[:, None]
    middle = 0.5 * (low[0] + high[0])
    pace = middle / (middle + pushed * (high[0] - low[0]))
    elapsed = times if parallel else np.concatenate([[0.0], np.cumsum(pace[:-1])]) / FPS
    angle = 2.0 * np.pi / lap * elapsed
    stylus = np.zeros((len(times), 7))
    stylus[:, 0], stylus[:, 1], stylus[:, 2], stylus[:, 3] = r * np.cos(angle), r * np.sin(angle), z, 1.0
    return Clip(map_poses(made, stylus), FPS, "blend")


def push_profile(times: Array) -> Array:
    """Offset of a hand that is pushed out (1) and in (-1) at times (n,) [s], with rests between."""
    phase = times / PUSH_INTERVAL % 2.0
    ramp = np.minimum(phase, 2.0 - phase) * PUSH_INTERVAL / _PUSH_TIME
    return np.asarray(cubic_steps(ramp) * np.where(times // (2.0 * PUSH_INTERVAL) % 2.0 == 0.0, 1.0, -1.0))


def animation_is_sound(made: Cylindrical | Composite, lap: float, parallel: bool) -> bool:
    """Whether the animation of `tour_animation` is sound (`is_sound`)."""
    made_of = (made.compiled().params, np.array([lap, parallel, *_domain(made).ravel()]))
    return is_sound(__name__, lambda: tour_animation(made, lap, parallel), made_of)


def is_sound(module: str, show: Callable[[], Clip], made_of: Iterable[npt.NDArray[np.generic]]) -> bool:
    """Whether soles neither penetrate the floor nor skate and joints stay within their ranges, within tolerances.

    The result is cached; needs compiled code. The arguments are those of `cached_verdict`.
    """

    def find() -> Array:
        shown = show()
        motion = motion_of(shown.poses, shown.fps)
        return np.array([[motion.lowest, motion.skate, beyond_ranges(shown.poses).max()]])

    lowest, skate, beyond = cached_array(results_folder(module), "sound", made_of, (1, 3), find)[0]
    return bool(lowest > -MAX_PENETRATION and skate <= MAX_FOOT_SKATE and beyond < MAX_JOINT_EXCESS)


def select_legs(
    make: Callable[[int], Carrying], names: Sequence[str], lap: float, parallel: bool
) -> tuple[Carrying, tuple[str, ...]]:
    """The map with the legs that best carry the other clips' arms, and remarks; needs compiled code.

    Parameters
    ----------
    make : callable
        Makes the map, a Cylindrical or Composite, with the legs of the clip of a given index.
    names : sequence of str
        Names of the clips whose legs it may have.
    lap : float
        Duration of a lap [s].
    parallel : bool
        Whether the field keeps the pace of a hand that is pushed off (`Follow.parallel`).
    """
    map_with_legs = cache(make)  # made on demand, since the first clip is mostly taken

    @cache
    def has_sound_legs(i: int) -> bool:
        return animation_is_sound(map_with_legs(i).with_share(0.0), lap, parallel)

    best, name, best_verdict = map_with_legs(0), names[0], Verdict(np.inf, 0.0)
    for soundness in (True, False):
        for share in SHARES:
            for i in (i for i in range(len(names)) if has_sound_legs(i) is soundness):
                made = map_with_legs(i).with_share(share)
                verdict = verdict_on(made, lap, parallel)
                if verdict.bearable and verdict.residual <= GOOD_RESIDUAL:
                    return made, ()
                if verdict.worse() < best_verdict.worse():
                    best, name, best_verdict = made, names[i], verdict
            if best_verdict.bearable:
                return best, ()
    return best, (f"the physical figure {best_verdict} with the legs of {name}, the best that is found at this lap",)
