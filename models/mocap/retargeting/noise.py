r"""Removal of noise, such as that of bodies estimated from video, by smoothing splines.

A motion is split at its jumps. In each piece every component of the joints' rotations is smoothed by the discrete
quintic smoothing spline (Whittaker 1923; Woltring 1986), whose frequency response is

.. math:: g(f) = \Bigl(1 + \Bigl(\frac{\sin(\pi f / f_s)}{\sin(\pi f_c / f_s)}\Bigr)^6\Bigr)^{-1} .

The cut-off f_c is the same for all components; it minimises the generalised cross-validation (Craven & Wahba 1979)

.. math:: V(f_c) = \sum_i \ln\bigl(r_i^2 + \epsilon^2\bigr) - 2\ln(1 - \gamma\,\bar g), \qquad \gamma = 1,

with r_i what the spline takes away from component i, RMS, and ḡ the mean of g over all frequencies, the share of the
spline's degrees of freedom. Sums over frequencies are cosine transforms (Garcia 2010) of the piece, continued at both
ends by its point reflection. Where more than a bound is taken away, from joints or from the path of the root, and the
highest quarter of the frequencies of the joints has nearly as much power as the second one, as noise has and limbs do
not, there is noise. It would hide which feet stand, whose speeds are differences of frames. So it is removed from
both, each with its own cut-off, that for γ = 1.4, which does not undersmooth where noise is correlated (Kim & Gu
2004), and at most `MOTION_BANDWIDTH`, as preparation does with every motion.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.fft import dct, idct

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.motion.clip import MOTION_BANDWIDTH
from models.mocap.readers.source_motion import SourceMotion
from models.mocap.retargeting.broken_frames import root_positions, thigh_length, used_joints
from models.mocap.retargeting.skeleton_roles import Roles

_MIN_FRAME_RATE = 23.0  # [1/s]; below it limbs move at all frequencies
_MIN_FRAMES = 24  # of a piece
_CUTOFFS = 48  # that are compared, between `_LOWEST` and nearly the highest frequency of the file
_LOWEST = 1.5  # [Hz]
_CAREFUL = 1.4  # γ of the cut-off with which noise is removed
_NEGLIGIBLE = 1e-4  # ε [rad], [m]: as from rounded numbers
# Noise that is removed, RMS [rad], [m]: the angle moves a foot as far as the path does. Of 162 captures at 45 frames a
# second or more those without visible noise have 0.18° and 2.1 mm at most.
_MIN_TURN, _MIN_SHIFT = 0.0031, 0.0025
# Least ratio of the power in the highest quarter of the frequencies to that in the second one, median of components. In
# three walks at 30 frames a second it is 0.002 to 0.015, with white noise of 0.5° 0.28 to 0.54, with 1 and 2° 0.60 to
# 0.86; in dances of 30 frames a second, whose steps are sampled too coarsely, at most 0.22.
_MIN_FLATNESS = 0.28
_PER_AXIS = 4.0 / 3.0**0.5  # RMS of a quaternion's four components into that of a turn about each axis
_THIGH = 0.45  # [m] of a human body, roughly: only noise is judged by it


class Noise(NamedTuple):
    """Noise that was removed, RMS: about an axis of a joint [rad], and in a direction of the path [m]; or zeros."""

    turn: float
    shift: float


def without_noise(motion: SourceMotion, roles: Roles, jumps: Sequence[int]) -> tuple[SourceMotion, Noise]:
    """The motion without the noise of its joints' rotations and of its path.

    Parameters
    ----------
    motion : SourceMotion
        The motion of a file.
    roles : Roles
        Which joint is which.
    jumps : sequence of int
        Frames after which the whole pose jumps.
    """
    pieces = [piece for piece in np.split(np.arange(motion.n_frames), np.asarray(jumps, dtype=int) + 1) if len(piece)]
    longest = max(pieces, key=len)
    thigh = thigh_length(motion, roles)
    if motion.fps < _MIN_FRAME_RATE or len(longest) < _MIN_FRAMES or thigh == 0.0:
        return motion, Noise(0.0, 0.0)
    rotations = np.concatenate([quaternions.sign_continuous(motion.rotations[piece]) for piece in pieces])
    turning = _PER_AXIS * rotations[longest][:, used_joints(motion, roles)].reshape(len(longest), -1)
    path = root_positions(motion, roles)[longest, 0] * _THIGH / thigh
    turns, shifts = _estimated(turning, motion.fps), _estimated(path, motion.fps)
    if not turns.flat or (turns.amount < _MIN_TURN and shifts.amount < _MIN_SHIFT):
        return motion, Noise(0.0, 0.0)
    smooth = np.concatenate([_smoothed(rotations[piece], turns.cutoff, motion.fps) for piece in pieces])
    smooth /= np.linalg.norm(smooth, axis=-1, keepdims=True)
    paths = np.concatenate([_smoothed(motion.translations[piece], shifts.cutoff, motion.fps) for piece in pieces])
    return replace(motion, rotations=smooth, translations=paths), Noise(turns.amount, shifts.amount)


class _Estimate(NamedTuple):
    """What the best spline takes away, RMS; whether it may be noise by its spectrum; the cut-off to remove it [Hz]."""

    amount: float
    flat: bool
    cutoff: float


def _estimated(values: Array, fps: float) -> _Estimate:
    """Noise of components (n, m), medians over those that move."""
    moving = values[:, values.std(axis=0) > 10.0 * _NEGLIGIBLE]
    if not moving.shape[1]:
        return _Estimate(0.0, False, MOTION_BANDWIDTH)
    power = np.asarray(dct(_continued(moving, fps)[0], axis=0, norm="ortho")) ** 2
    cutoffs = np.geomspace(_LOWEST, 0.49 * fps, _CUTOFFS)
    responses = np.array([_response(len(power), cutoff, fps) for cutoff in cutoffs])
    removed = (1.0 - responses) ** 2 @ power / len(power)  # (cutoffs, m), squares
    residual, freedom = np.log(removed + _NEGLIGIBLE**2).sum(axis=1), responses.mean(axis=1)

    def best(inflation: float) -> int:
        left = np.maximum(1.0 - inflation * freedom, 1e-9)
        return int(np.argmin(residual - 2.0 * moving.shape[1] * np.log(left)))

    _, second, _, highest = (quarter.mean(axis=0) for quarter in np.array_split(power, 4))
    flatness = float(np.median(highest / (second + _NEGLIGIBLE**2)))
    return _Estimate(
        float(np.median(np.sqrt(removed[best(1.0)]))),
        flatness >= _MIN_FLATNESS,
        min(float(cutoffs[best(_CAREFUL)]), MOTION_BANDWIDTH),
    )


def _smoothed(values: Array, cutoff: float, fps: float) -> Array:
    """Values (n, …) without what is above the cut-off."""
    if len(values) < _MIN_FRAMES:
        return values
    flat = values.reshape(len(values), -1)
    level, line, first = _continued(flat, fps)
    passed = _response(len(level), cutoff, fps)[:, None] * np.asarray(dct(level, axis=0, norm="ortho"))
    return (np.asarray(idct(passed, axis=0, norm="ortho")) + line)[first : first + len(values)].reshape(values.shape)


def _continued(values: Array, fps: float) -> tuple[Array, Array, int]:
    """Values (n, m) with up to a second of their point reflection at both ends, less a line from the first to the last.

    Also returned: the line, and the index at which the values begin.
    """
    margin = min(len(values) - 1, round(fps))
    before, after = 2.0 * values[0] - values[margin:0:-1], 2.0 * values[-1] - values[-2 : -margin - 2 : -1]
    whole = np.concatenate((before, values, after))
    line = whole[0] + np.linspace(0.0, 1.0, len(whole))[:, None] * (whole[-1] - whole[0])
    return whole - line, line, margin


def _response(n: int, cutoff: float, fps: float) -> Array:
    """G at the n frequencies of a cosine transform."""
    return 1.0 / (1.0 + (np.sin(0.5 * np.pi * np.arange(n) / n) / np.sin(np.pi * cutoff / fps)) ** 6)
