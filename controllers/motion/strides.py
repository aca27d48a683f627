r"""Repeats of each clip in a lap: travelling clips stride in step with each other, and all play near their own pace.

A walk of two strides and a run of three have no common phase except at the lap's ends. A jog of 0.8 s in a lap with a
dance of 4 s would be played five times too slowly: its flights would need a 25th of gravity. A loop can be repeated
any number of times: it stays closed, and its drift and duration scale. So with d_i the duration of a clip, s_i its
number of strides and T the duration of the lap, clip i is played k_i / s_i times,

.. math:: k = \arg\min_k \max_i w\!\left(\log \frac{k\,d_i}{s_i\,T}\right), \qquad w(x) = \max(-x, 3 x)

where k is common to all travelling clips, which therefore take the same number of strides; for every other clip k_i is
chosen separately with s_i = 1. If the legs are those of one clip, strides need not be in step, and k_i is chosen
separately for each clip. Faster counts three times as much as slower, since a motion played f times as fast needs f²
times its forces, and a jump cannot fall faster than gravity allows.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.motion.loops import Loop
from geometry.arrays import Array, IntArray

_SAMPLES = 128  # per lap; half or twice as many give the same strides for the nine embedded clips
_MAX_REPEATS = 12  # largest number of repeats that is tried for a clip
_REPEAT_TOLERANCE = 1e-3  # [m], or components of rotations: largest difference between repeats
_FASTER_COST = 3.0  # cost of playing faster relative to slower
_MIN_LAP_DURATION, _MAX_LAP_DURATION = 3.0, 6.0  # [s] limits of a natural lap, unless a loop lasts longer
# [s] longest natural lap but for one stride of the first loop: at 10 mm/s and less, encoders and friction disturb the
# hand's pace, so that legs of 6.8 s have 25 % residual in a lap of 68 s, and 12 in one of 27 with arms 2.5 as fast
_MAX_STEADY_LAP = 30.0
MIN_TRAVEL = 0.3
"""Travel of a lap below which it is not a gait [m]."""


def strides(loop: Loop) -> int:
    """Number of strides of a loop: repeats of the same motion in a lap."""
    phase, still = np.arange(_SAMPLES) / _SAMPLES, np.zeros(_SAMPLES)
    channels = loop.channels(phase, still)
    if np.ptp(channels, axis=0).max() < _REPEAT_TOLERANCE:
        return 1
    repeats: IntArray = np.arange(_MAX_REPEATS, 1, -1)
    for n in repeats:
        later = loop.channels(phase + 1.0 / n, still)
        dots = np.einsum("sjx,sjx->sj", *(part[:, 3:].reshape(_SAMPLES, -1, 4) for part in (channels, later)))
        later[:, 3:] *= np.repeat(np.where(dots < 0.0, -1.0, 1.0), 4, axis=1)
        if np.abs(later - channels).max() < _REPEAT_TOLERANCE:
            return int(n)
    return 1


def fit_to_lap(loops: Sequence[Loop], lap: float | None = None, apart: bool = False) -> list[Loop]:
    """The loops, each repeated as often as it fits a lap.

    Parameters
    ----------
    loops : sequence of Loop
        Clips as closed loops.
    lap : float, optional
        T [s]. Without it clips are played once, except that travelling clips of several strides get as many strides as
        the first of them.
    apart : bool
        Whether each clip is fitted separately, travelling ones too.
    """
    if lap is None:
        counts = _stride_counts(loops)
        wanted = next((count for count in counts if count > 1), 1)
        shares: Sequence[float] = [wanted / count if count > 1 else 1.0 for count in counts]
    else:
        shares = _shares(loops, np.array([lap]), apart)[0].tolist()
    return [
        replace(loop, drift=share * loop.drift, duration=share * loop.duration, share=share)
        for loop, share in zip(loops, shares, strict=True)
    ]


def played_durations(loops: Sequence[Loop], laps: Array, apart: bool = False) -> Array:
    """Durations at their own pace [s] of what laps (n,) play of each loop, as in `fit_to_lap`, shape (n, loops)."""
    return _shares(loops, laps, apart) * np.array([loop.duration for loop in loops])


def _shares(loops: Sequence[Loop], laps: Array, apart: bool) -> Array:
    """How often laps (n,) [s] play each loop, shape (n, loops)."""
    counts = np.array(_stride_counts(loops))
    durations = np.array([loop.duration for loop in loops]) / counts
    travels = np.array([not apart and float(np.hypot(*loop.drift[:2])) > MIN_TRAVEL for loop in loops])
    repeats = np.empty((len(laps), len(loops)))
    for row, lap in zip(repeats, laps.tolist(), strict=True):
        if travels.any():
            row[travels] = _best_repeat_count(durations[travels], lap)
        for i in np.flatnonzero(~travels):
            row[i] = _best_repeat_count(durations[i : i + 1], lap)
    return repeats / counts


def _stride_counts(loops: Sequence[Loop]) -> list[int]:
    return [strides(loop) if np.hypot(*loop.drift[:2]) > 0.0 else 1 for loop in loops]


def _best_repeat_count(durations: Array, lap: float) -> int:
    """Number of repeats of durations [s] (n,) that minimises the worst mismatch with a lap [s]."""
    logs = np.log(durations / lap)
    slowest, fastest = float(logs.min()), float(logs.max())
    # Convex in log k: least where the slowest is as much too slow as the fastest is too fast, or beside it.
    fewer = max(1, int(np.exp(-(slowest + _FASTER_COST * fastest) / (1.0 + _FASTER_COST))))

    def mismatch(count: int) -> float:
        return max(-(np.log(count) + slowest), _FASTER_COST * (np.log(count) + fastest))

    return min(fewer, fewer + 1, key=mismatch)


def natural_lap(loops: Sequence[Loop], apart: bool = False) -> float:
    """Duration of a lap [s] in which the first loop plays at its own pace, and the others as nearly as possible.

    Since the legs of a blend may be those of the first loop, the lap is a whole number of its strides, from 3 to 6 s or
    the duration of the longest loop, but at most 30 s or a single stride; of all within 2 % of the best, the shortest
    is chosen. A lap of several short cycles gives the hand more time to change the blend. `apart` is as in
    `fit_to_lap`.
    """
    longest = min(max(_MAX_LAP_DURATION, *(loop.duration for loop in loops)), _MAX_STEADY_LAP)
    laps = whole_strides(loops[0], longest)
    worst = np.abs(np.log(played_durations(loops, laps, apart) / laps[:, None])).max(axis=1)
    return float(laps[np.flatnonzero(worst < worst.min() + 0.02)[0]])


def whole_strides(loop: Loop, longest: float) -> Array:
    """Durations of whole numbers of strides of a loop from 3 s to `longest`, or of the fewest that last 3 s [s]."""
    stride = loop.duration / _stride_counts([loop])[0]
    fewest = int(np.ceil(_MIN_LAP_DURATION / stride - _REPEAT_TOLERANCE))
    most = max(fewest, int(longest / stride + _REPEAT_TOLERANCE))
    return np.arange(fewest, most + 1, dtype=np.float64) * stride
