r"""Repeats of clips along their lifted curves: laps are not too short, and gaits take as many strides in each.

No hand can be led evenly round a lap in half a second, so a closed clip shorter than `_MIN_LAP_DURATION` is repeated: a
captured run with strides of 0.55 s had a residual of 21 % of body weight with one stride a lap, and of 11 % with two.

A walk of two strides a lap and a run of three are in step at one angle only; a hand that passes from curve to curve
elsewhere plays mixtures that no figure can perform. With equal numbers left swings with left at every angle. The
strides of a gait are counted by the dominant harmonic of the thighs' difference in flexion,

.. math:: n = \arg\max_{k \ge 1} |\hat d_k|, \qquad d = \varphi_\text{left} - \varphi_\text{right},

with φ the hip's rotation about its lateral axis and :math:`\hat d` the Fourier transform of d over the clip.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.motion.loops import closed_loop
from controllers.motion.strides import MIN_TRAVEL, strides
from geometry import quaternions
from models.humanoid.skeleton import BODIES
from models.mocap.motion.clip import Clip
from models.mocap.preparation.poses import extend_periodically

_MIN_LAP_DURATION = 2.0  # [s]; with 4 s a sprint is repeated 8 times, and the figure falls because of encoder noise
# [s] of the slowest gait in step: slower hands are pushed from their pace, and encoders and friction disturb it
_MAX_LAP_DURATION = 6.0
_MIN_SHARE = 0.5  # of the variance of d that a gait's harmonic has at least
_THIGHS = [BODIES.index(f"{side}_thigh") for side in ("left", "right")]


def repeated(clips: Sequence[Clip]) -> tuple[tuple[Clip, ...], tuple[int, ...]]:
    """Clips as they are played in a lap, and how often each is repeated there.

    A gait that repeats itself exactly, as an embedded one does, is cut to one repeat if all gaits can be in step.
    """
    counts = [gait_strides(clip) for clip in clips]
    cut = [_one_repeat(clip) if count else (clip, 1) for clip, count in zip(clips, counts, strict=True)]
    units = [(unit, count // parts) for (unit, parts), count in zip(cut, counts, strict=True)]
    common = _common_strides([(unit.duration, count) for unit, count in units if count])
    if not common:
        units = [(clip, 0) for clip in clips]
    rounds = tuple(
        common // count if count else math.ceil(_MIN_LAP_DURATION / unit.duration) if unit.closes() else 1
        for unit, count in units
    )
    return tuple(_repeat(unit, times) for (unit, _), times in zip(units, rounds, strict=True)), rounds


def gait_strides(clip: Clip) -> int:
    """Number of strides of a closed clip that walks or runs; 0 for any other clip."""
    if not clip.closes() or math.hypot(*(clip.poses[-1, :2] - clip.poses[0, :2])) < MIN_TRAVEL:
        return 0
    thighs = quaternions.logarithm(clip.poses[:-1, 3:].reshape(clip.n_frames - 1, -1, 4)[:, _THIGHS])
    power = np.square(np.abs(np.fft.rfft(thighs[:, 0, 1] - thighs[:, 1, 1])))[1:]
    return int(power.argmax()) + 1 if power.max() > _MIN_SHARE * power.sum() else 0


def _one_repeat(clip: Clip) -> tuple[Clip, int]:
    """The first of a clip's exact repeats, and their number."""
    parts = strides(closed_loop(clip.poses, clip.fps))
    frames, rest = divmod(clip.n_frames - 1, parts)
    return (clip, 1) if rest else (replace(clip, poses=clip.poses[: frames + 1]), parts)


def _common_strides(gaits: Sequence[tuple[float, int]]) -> int:
    """Least number of strides in a lap that suits gaits, each with a duration [s] and strides; 0 if none does."""
    if not gaits:
        return 0
    least = math.lcm(*(count for _, count in gaits))
    times = math.ceil(max(_MIN_LAP_DURATION * count / seconds for seconds, count in gaits) / least)
    slowest = max(seconds / count for seconds, count in gaits)
    return times * least if times * least * slowest <= _MAX_LAP_DURATION else 0


def _repeat(clip: Clip, times: int) -> Clip:
    """A closed clip repeated several times."""
    poses, first = extend_periodically(clip, (times - 1) * (clip.n_frames - 1))
    return replace(clip, poses=poses[first:])
