r"""Choice of the clip whose legs and trunk the map plays if clips move too differently to be blended as a whole.

Only arms and head are then blended. A kick is balanced by the arms of its own clip, and a flight is ballistic only with
them, so simulation decides: for the legs of each clip in turn, the physical figure follows the map's animation while a
hand wanders through the whole domain and pushes. The first clip in the user's order that is followed well is taken, or
else the best one. If the figure falls with the best, or its residual is too large, the other clips' arms are blended in
with a smaller share λ, down to 0, where the clip plays alone. Legs that skate, penetrate the floor or exceed joint
ranges are tried last. If nothing is followed well enough, a remark says so, and the first is taken that the figure
follows while the hand is left alone: when a push makes it fall does not tell which of them stands without one.

Curves of a lifted map lie some 10 mm apart, and a push of 2.5 N moves the hand by 8 mm within 0.15 s, at any moment of
the lap and not only where motions agree. If the figure does not follow the whole map, or its feet skate, its legs and
trunk stay with the curve's own clip, and the other clips' arms are blended in with as large a share as the figure can
follow.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeVar

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.lifted import Lifted
from experiments.fitting.animation_trial import AnimationTrial
from experiments.fitting.hand_tours import domain, lap_left_alone, tour_along_curve, tour_duration, tour_of_domain
from experiments.preparation.followed import TRIAL_SECONDS, Followed
from models.mocap.preparation.bounds import MAX_RESIDUAL_IN_FLIGHTS

_SHARES = (1.0, 0.5, 0.25, 0.0)  # λ of `with_share`, in the order in which they are tried
_LEAST_SHARE = 0.25  # with which the hand still changes the arms
# [body weights] RMS residual up to which the first clip is taken at once
_GOOD_RESIDUAL = MAX_RESIDUAL_IN_FLIGHTS / 2
# [body weights] RMS residual up to which a share is taken without trying smaller ones, though not zero: with 11.5 % in
# the trial, two of nine hands that push a composite of captures make the figure fall, none of five with half the share
# and 7.0 %.
_SAFE_RESIDUAL = MAX_RESIDUAL_IN_FLIGHTS * 5 / 6
# [body weights] Residual by which a smaller share of the arms has to be better: of 14 sets of captures that are pushed
# off lifted curves four would give up half or more of the arms for less. Half the value halves the arms in two of them.
_LEAST_GAIN = 0.005
_NOTHING_FOUND = Followed(np.inf, 0.0)  # worse than every trial

Carrying = TypeVar("Carrying", Cylindrical, Composite)


def trial_of(haptic_map: Cylindrical | Composite, lap: float, parallel: bool) -> AnimationTrial:
    """The trial in which the physical figure follows a map about a circle for 20 s, or two laps if that is longer."""
    made_of = (haptic_map.compiled().params, np.array([lap, parallel, *domain(haptic_map).ravel()]))
    return AnimationTrial(__name__, lambda: tour_of_domain(haptic_map, lap, parallel), tour_duration(lap), made_of)


def stands_left_alone(haptic_map: Cylindrical | Composite, lap: float) -> bool:
    """Whether the physical figure follows a map well enough while the hand is not pushed; needs compiled code."""
    made_of = (haptic_map.compiled().params, np.array([lap, *domain(haptic_map).ravel()]))
    trial = AnimationTrial(__name__, lambda: lap_left_alone(haptic_map, lap), tour_duration(lap), made_of)
    return trial.followed().stands


def single_clip_remarks(haptic_map: Cylindrical, name: str, lap: float, parallel: bool) -> tuple[str, ...]:
    """Remark on a map of one clip that the physical figure does not follow well enough; needs compiled code."""
    result = trial_of(haptic_map, lap, parallel).followed()
    if result.stands:
        return ()
    return (_remark(result, f"{name} at this lap", stands_left_alone(haptic_map, lap)),)


def _remark(result: Followed, what: str, stands: bool) -> str:
    """Remark on a map that is not followed well enough by a hand that pushes; `stands`: it is without pushes."""
    when, otherwise = ("pushed, ", "; left alone it stands") if stands else ("", "")
    return f"{when}the physical figure {result} with {what}{otherwise}"


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
        return trial_of(map_with_legs(i).with_share(0.0), lap, parallel).is_sound()

    best, name, best_result = map_with_legs(0), names[0], _NOTHING_FOUND
    for soundness in (True, False):
        for share in _SHARES:
            least_gain = _LEAST_GAIN * best_result.stands
            for i in (i for i in range(len(names)) if has_sound_legs(i) is soundness):
                haptic_map = map_with_legs(i).with_share(share)
                result = trial_of(haptic_map, lap, parallel).followed()
                if result.stands and result.residual <= _GOOD_RESIDUAL:
                    return haptic_map, ()
                if result.is_better(best_result, least_gain):
                    best, name, best_result, least_gain = haptic_map, names[i], result, 0.0
            if best_result.stands and (best_result.residual <= _SAFE_RESIDUAL or share <= _LEAST_SHARE):
                return best, ()
    found = f"the legs of {name}, the best found at this lap"
    if stands_left_alone(best, lap):
        return best, (_remark(best_result, found, stands=True),)
    for share in (1.0, 0.0) if best_result.fell is not None else ():
        for i in sorted(range(len(names)), key=has_sound_legs, reverse=True):
            haptic_map = map_with_legs(i).with_share(share)
            if stands_left_alone(haptic_map, lap):
                result = trial_of(haptic_map, lap, parallel).followed()
                return haptic_map, (_remark(result, f"the legs of {names[i]}", stands=True),)
    return best, (_remark(best_result, found, stands=False),)


def followed_map(
    haptic_map: Lifted, curve: Trajectory, clip: int, arms: Sequence[int], keeps_pace: bool
) -> tuple[Lifted, tuple[str, ...]]:
    """The map, or as much of it as the physical figure follows when pushed off a curve, and remarks.

    Parameters
    ----------
    haptic_map : Lifted
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

    def trial_of(part: Lifted) -> AnimationTrial:
        made_of = part.compiled().params, np.asarray(curve.times), np.asarray(curve.positions), np.array([keeps_pace])
        return AnimationTrial(__name__, lambda: tour_along_curve(part, curve, keeps_pace), TRIAL_SECONDS, made_of)

    whole = trial_of(haptic_map).followed()
    # Pushes come once a lap: a stance in which the feet skate is one in every lap.
    sound = not whole.stands or trial_of(haptic_map).is_sound(in_every_stance=True)
    if whole.stands and sound:
        return haptic_map, ()
    best, best_result = (haptic_map, whole) if sound else (haptic_map, _NOTHING_FOUND)
    for share in _SHARES:
        part = haptic_map.with_legs_of(clip, arms, share)
        result = trial_of(part).followed()
        least_gain = _LEAST_GAIN * best_result.stands
        if result.is_better(best_result, least_gain):
            best, best_result = part, result
        if best_result.stands and best_result.residual <= _GOOD_RESIDUAL:
            break
    fault = f"the physical figure {whole}" if sound else "the animation's feet skate or sink, or joints go too far,"
    remark = f"pushed off its curve to those beside it, {fault} with the whole map"
    return best, (remark if best_result.stands else f"{remark}, and {best_result} with the best part of it",)
