r"""How often a lap plays each clip: travelling clips in step with each other, all near their own pace.

A walk of two strides and a run of three have no phase in common but at the lap's ends, and a jog of 0.8 s beside a
dance of 4 s would be played five times too slowly: its flights would ask for a 25th of gravity. A loop can be played
round any number of times: it stays closed, and its drift and time are in proportion. So with d_i the time of a clip,
s_i its strides and T the time of the lap, clip i is played k_i / s_i times,

.. math:: k = \arg\min_k \max_i w\!\left(\log \frac{k\,d_i}{s_i\,T}\right), \qquad w(x) = \max(-x, 3 x)

over all that travel, which so take as many strides, and k_i likewise of each other clip alone (s_i = 1); of each clip
alone where legs are one clip's, so that strides need not be in step. Faster counts thrice, for a body played f times as
fast needs f² of its forces, and one that jumps cannot fall faster than it does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.motion.loops import Loop
from controllers.state import Array, IntArray

_SAMPLES = 128
_MOST = 12  # repeats looked for in a clip
_SAME = 1e-3  # by which lengths [m] and components of rotations may differ from one repeat to the next
_FASTER = 3.0  # times as bad as slower
_FURTHEST = 0.3  # [m] a lap that goes less far is no gait


def strides(loop: Loop) -> int:
    """How many times a loop repeats itself in a lap."""
    phase, still = np.arange(_SAMPLES) / _SAMPLES, np.zeros(_SAMPLES)
    channels = loop.channels(phase, still)
    if np.ptp(channels, axis=0).max() < _SAME:
        return 1
    repeats: IntArray = np.arange(_MOST, 1, -1)
    for n in repeats:
        later = loop.channels(phase + 1.0 / n, still)
        dots = np.einsum("sjx,sjx->sj", *(part[:, 3:].reshape(_SAMPLES, -1, 4) for part in (channels, later)))
        later[:, 3:] *= np.repeat(np.where(dots < 0.0, -1.0, 1.0), 4, axis=1)
        if np.abs(later - channels).max() < _SAME:
            return int(n)
    return 1


def in_step(loops: Sequence[Loop], lap: float | None = None, apart: bool = False) -> list[Loop]:
    """The loops, each played as often as it fits a lap.

    Parameters
    ----------
    loops : sequence of Loop
        Clips as closed loops.
    lap : float, optional
        T [s]. Without it clips are played once, and those that travel and repeat themselves with as many strides as the
        first of them.
    apart : bool
        Each by itself, travelling ones too.
    """
    counts = [strides(loop) if np.hypot(*loop.drift[:2]) > 0.0 else 1 for loop in loops]
    if lap is None:
        wanted = next((count for count in counts if count > 1), 1)
        shares = [wanted / count if count > 1 else 1.0 for count in counts]
    else:
        travels = [not apart and float(np.hypot(*loop.drift[:2])) > _FURTHEST for loop in loops]
        durations = np.array([loop.duration / count for loop, count in zip(loops, counts, strict=True)])
        common = _times(durations[travels], lap) if any(travels) else 1
        shares = [
            (common if goes else _times(np.array([duration]), lap)) / count
            for duration, count, goes in zip(durations, counts, travels, strict=True)
        ]
    return [
        replace(loop, drift=share * loop.drift, duration=share * loop.duration, share=share)
        for loop, share in zip(loops, shares, strict=True)
    ]


def _times(durations: Array, lap: float) -> int:
    """How often what lasts so long [s] (n,) fits a lap [s], the worst of them best."""
    logs = np.log(durations / lap)
    first = max(1, int(np.exp(-logs.max())))
    ways = np.arange(first, int(np.exp(-logs.min())) + 2)
    faster = np.log(ways)[:, None] + logs
    return int(ways[np.maximum(-faster, _FASTER * faster).max(axis=1).argmin()])


def natural_lap(loops: Sequence[Loop], shortest: float = 3.0, longest: float = 6.0) -> float:
    """Time of a lap [s] in which the first loop goes at its own pace, and the others `in_step` are as near as can be.

    The legs of a blend may be the first loop's, so the lap is a number of its strides: from the shortest to the
    longest time, or that of the longest loop; of those within 2 % of the best the shortest. A lap of several short
    cycles leaves a hand the time of all of them to change the blend.
    """
    first = loops[0]
    stride = first.duration / (strides(first) if np.hypot(*first.drift[:2]) > 0.0 else 1)
    least = int(np.ceil(shortest / stride - _SAME))
    most = int(max(longest, *(loop.duration for loop in loops)) / stride + _SAME)
    laps = stride * np.arange(least, max(least, most) + 1)
    worst = np.array([max(abs(np.log(loop.duration / lap)) for loop in in_step(loops, float(lap))) for lap in laps])
    return float(laps[np.flatnonzero(worst < worst.min() + 0.02)[0]])
