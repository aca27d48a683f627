"""Travelling clips in step: each takes as many strides a lap as the first of them.

A walk of two strides and a run of three have no phase in common but at the lap's ends. A loop that repeats itself
exactly can be played round by any number of its repeats: it stays closed, and its drift and time are in proportion.
"""

from dataclasses import replace

import numpy as np

from controllers.motion.loops import Loop
from controllers.state import IntArray

_SAMPLES = 128
_MOST = 12  # repeats looked for in a clip
_SAME = 1e-3  # by which lengths [m] and components of rotations may differ from one repeat to the next


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


def in_step(loops: list[Loop]) -> list[Loop]:
    """The loops, those that travel and repeat themselves with as many strides a lap as the first of those."""
    counts = [strides(loop) if np.hypot(*loop.drift[:2]) > 0.0 else 1 for loop in loops]
    wanted = next((count for count in counts if count > 1), 1)
    shares = [wanted / count if count > 1 else 1.0 for count in counts]
    return [
        replace(loop, drift=share * loop.drift, duration=share * loop.duration, share=share)
        for loop, share in zip(loops, shares, strict=True)
    ]
