"""Which laps, and rounds of laps, suit the clips of a map: in which they play near enough to their own pace."""

from collections.abc import Sequence

import numpy as np

from controllers.motion.loops import Loop, checked_clip, closed_loop
from controllers.motion.strides import fit_to_lap, natural_lap, played_durations, whole_strides
from experiments.fitting.blendable import longest_flight
from geometry.arrays import Array
from models.mocap.motion.clip import Clip

MIN_PACE, MAX_PACE = 0.75, 1.33  # played pace over the clip's own: inertial forces scale with its square, 0.56 to 1.8
MIN_FLYING_PACE, MAX_FLYING_PACE = 0.9, 1.1  # the same for clips with flights, which then need 0.8 to 1.2 of gravity
# The same for clips that are played by themselves. Of the tuning half of the captures the figure follows six without
# flights with 9 % of weight at most at these paces, and at 1.2 with 5 to 18; five with flights of 0.1 s at most with 6
# to 11 at 0.95 and 11 to 27 at 1.05; jumps at neither.
_PACES_ALONE, _FLYING_PACES_ALONE = (0.75, 1.05), (0.97, 1.02)
_ROUNDING = 1e-9  # by which a pace at its limit may be beyond it
MAX_LAPS = 4  # laps in a round: with more, a hand waits long for a transition, and there are many to compute
_MAX_ROUND_LAP = 6.0  # [s] of a lap in a round: in slower rivers a push hardly moves a hand to another one
_LAP_TOLERANCE = 0.02  # laps of less relative difference count as equal: `natural_lap` takes the shortest of them


def timing_clip(clips: Sequence[Clip]) -> int:
    """Index of the clip that times the lap: the first without a flight, or else the first.

    Which clip's legs are combined with the arms of the others is found with the physical figure (`leg_choice`): arms
    move the centre of mass, so flights of a clip are ballistic only with its own arms.
    """
    return next((i for i, clip in enumerate(clips) if longest_flight(clip) == 0.0), 0)


def lap_suits_blend(clips: Sequence[Clip], loops: Sequence[Loop], lap: float) -> bool:
    """Whether a lap [s] plays all clips near enough to their own pace to be blended; flights have tighter limits."""
    paces = [loop.duration / lap for loop in loops]
    any_flight = any(longest_flight(clip) > 0.0 for clip in clips)
    slowest, fastest = (MIN_FLYING_PACE, MAX_FLYING_PACE) if any_flight else (MIN_PACE, MAX_PACE)
    return all(slowest <= pace <= fastest for pace in paces)


def pace_mismatch(clips: Sequence[Clip], loops: Sequence[Loop], seconds: float) -> float:
    """How far beyond limits of their paces a time [s] plays loops, each by itself; 0 if each is within its limits.

    It is the sum over the loops of max(log pace / log limit - 1, 0), with the limit of slower or of faster playing.
    """
    return float(_mismatches(clips, np.array([[loop.duration / seconds for loop in loops]]))[0])


def _mismatches(clips: Sequence[Clip], paces: Array) -> Array:
    """`pace_mismatch` at paces (n, clips)."""
    limits = [_FLYING_PACES_ALONE if longest_flight(clip) > 0.0 else _PACES_ALONE for clip in clips]
    slowest, fastest = np.array(limits).T
    ratios = np.log(paces) / np.log(np.where(paces > 1.0, fastest, slowest))
    return np.maximum(ratios - 1.0 - _ROUNDING, 0.0).sum(axis=1)


def fit_round(clips: Sequence[Clip], rounds: Array) -> tuple[float, bool]:
    """The shortest of rounds (n,) [s], in order, that suits clips that are played by themselves, or else the best.

    With it, whether strides of the clips are out of step in it.
    """
    loops = closed_loops(clips)
    tried = np.stack(
        [_mismatches(clips, played_durations(loops, rounds, apart) / rounds[:, None]) for apart in (False, True)],
        axis=1,
    )
    i, apart = divmod(int(np.flatnonzero(tried.ravel() <= 1.1 * tried.min())[0]), 2)
    return float(rounds[i]), bool(apart)


def closed_loops(clips: Sequence[Clip]) -> list[Loop]:
    """The clips as closed loops."""
    return [closed_loop(checked_clip(clip.poses, clip.fps, clip.name), clip.fps) for clip in clips]


def best_lap(clips: Sequence[Clip], timing: int | None) -> float:
    """Duration of a lap [s] in which the clip of index `timing` plays at its own pace, and the others nearly so.

    If there is no such lap with travelling clips in step, they need not be, as on the maps. Without `timing` each clip
    is played by itself in rounds of one to `MAX_LAPS` laps, in which all are near their own pace.
    """
    loops = closed_loops(clips)
    if timing is None:
        rounds = np.sort(np.concatenate([whole_strides(loop, MAX_LAPS * _MAX_ROUND_LAP) for loop in loops]))
        seconds, _ = fit_round(clips, rounds)
        return round(seconds / min(np.ceil(seconds / _MAX_ROUND_LAP), MAX_LAPS), 6)
    loops = [loops[timing], *loops[:timing], *loops[timing + 1 :]]
    lap = natural_lap(loops)
    if not lap_suits_blend(clips, fit_to_lap(loops, lap), lap):
        lap = natural_lap(loops, apart=True)
    return round(lap, 6)


def off_pace(
    clips: Sequence[Clip], loops: Sequence[Loop], lap: float, laps: int, timing: int | None
) -> tuple[str, ...]:
    """Remark on clips that laps [s] play much faster or slower than their own pace, as loops made by `fit_to_lap`.

    `laps` is the number of laps in a round, in which each loop is played once; `timing` is as in `best_lap`.
    """
    paces = {clip.name: loop.duration / (laps * lap) for clip, loop in zip(clips, loops, strict=True)}
    outside = [f"{name} at {pace:.2f}" for name, pace in paces.items() if not MIN_PACE <= pace <= MAX_PACE]
    if not outside:
        return ()
    best = best_lap(clips, timing)
    better = (
        f"--lap {best:.1f} suits them best"
        if abs(best / lap - 1.0) > _LAP_TOLERANCE
        else "no lap suits them all better"
    )
    played = f"a lap of {lap:.1f} s plays" if laps == 1 else f"{laps} laps of {lap:.1f} s play"
    return (f"{played} {', '.join(outside)} times its recorded speed; {better}",)
