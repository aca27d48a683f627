"""Time alignment of loops: a shift of the phase, then, if it gains enough, a smooth, monotone, periodic time warp."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from controllers.legs.limb_ends import SOFTMIN_WIDTH, end_poses, lowest_point
from controllers.legs.limbs import Limb
from controllers.motion.loops import Loop
from controllers.motion.time_warping import least_cost_lead, smooth_lead
from geometry.arrays import Array, IntArray

MAX_LEAD = 0.125  # largest lead or lag of a warp, as a fraction of the lap

# Samples of a lap. In four sets of embedded clips, half as many change joint angles by 1 to 2° RMS, twice as many by
# at most 0.8°.
_SAMPLES = 128
_MAX_LEAD = int(MAX_LEAD * _SAMPLES)
_MAX_PACE_CHANGE = 0.25  # largest change of the pace by a warp
# Weight of stance relative to rotations: a blend of cheer and ginga slides 1.0 cm, also with half of it; twice: 0.7.
_STANCE_WEIGHT = 2.0
# [m], [m per lap] height and speed at which the degree of stance is halved
_HALF_STANCE_HEIGHT, _HALF_STANCE_SPEED = 0.02, 0.5
# A warp that leaves more of the mismatch is not used: if every pair were warped, a few percent would be gained, and
# flights would be distorted (accelerations up to 2.8 times the clip's own).
_MAX_MISMATCH_RATIO = 0.9


def _features(loop: Loop, limbs: Sequence[Limb]) -> Array:
    """Features to be aligned, shape (samples, features): rotation matrices, height of the root, stance of the ends.

    Matrices instead of quaternions, since those have no ambiguous sign.
    """
    channels = loop.channels(np.arange(_SAMPLES) / _SAMPLES, np.zeros(_SAMPLES))
    w, x, y, z = np.moveaxis(channels[:, 3:].reshape(_SAMPLES, -1, 4), -1, 0)
    matrix = np.stack(
        [w * w + x * x, y * y + w * w, z * z + w * w, x * y - w * z, x * y + w * z, x * z - w * y, x * z + w * y,
         y * z - w * x, y * z + w * x],
        axis=-1,
    )  # fmt: skip
    stance = [_STANCE_WEIGHT * _stance_degree(channels, loop.drift, limb)[:, None] for limb in limbs]
    return np.concatenate([2.0 * matrix.reshape(_SAMPLES, -1), channels[:, 2:3], *stance], axis=1)


def _stance_degree(channels: Array, drift: Array, limb: Limb) -> Array:
    """Degree from 0 to 1 to which an end is in stance (low, and slow over the ground); shape (samples,)."""
    place, quaternions = (part[:, 0] for part in end_poses(channels[:, None], limb))
    height = place[:, 2] + lowest_point(quaternions, limb, SOFTMIN_WIDTH)
    ahead, behind = (np.roll(place, shift, axis=0) for shift in (-1, 1))
    across = drift[2] * np.stack([-place[:, 1], place[:, 0]], axis=1)
    # The velocity over the ground is that of the drift plus that in the frame of the drift.
    speed = np.linalg.norm(0.5 * _SAMPLES * (ahead - behind)[:, :2] + drift[:2] + across, axis=1)
    low = 1.0 / (1.0 + ((height - height.min()) / _HALF_STANCE_HEIGHT) ** 2)
    return low / (1.0 + (speed / _HALF_STANCE_SPEED) ** 2)


def _best_shift(reference: Array, features: Array) -> int:
    """Circular shift [samples] of best correlation; 0 if the correlation hardly depends on the shift."""
    spectra = np.conj(np.fft.rfft(reference, axis=0)) * np.fft.rfft(features, axis=0)
    correlation = np.fft.irfft(spectra.sum(axis=1), _SAMPLES)
    spread = float(np.sqrt((reference.var(axis=0).sum()) * (features.var(axis=0).sum()))) * _SAMPLES
    best = int(correlation.argmax())
    return best if correlation[best] - correlation[0] > 0.02 * spread + 1e-12 else 0


def _time_warp(reference: Array, features: Array) -> Array:
    """Lead of the loop's phase over the reference's at each sample [samples], by dynamic time warping in a band.

    The lead changes by at most one sample per sample, and is zero at the lap's ends.
    """
    leads = np.arange(-_MAX_LEAD, _MAX_LEAD + 1)
    index: IntArray = (np.arange(_SAMPLES)[:, None] + leads) % _SAMPLES
    cost = ((features[index] - reference[:, None, :]) ** 2).sum(axis=2)
    # A small cost of the lead, so that without a difference in mismatch there is no warp.
    cost = cost / (cost.mean() + 1e-12) + 0.05 * np.abs(leads / _MAX_LEAD)
    return least_cost_lead(cost, (0, 1, -1), np.array([0.0, 0.2, 0.2])).astype(np.float64)


def _smooth_lead(lead: Array) -> Array:
    """Periodic lead smoothed by a Gaussian of a sixteenth of the lap, and scaled to the steepest slope allowed."""
    smooth = smooth_lead(lead, 16.0)
    steepest = float(np.abs(np.diff(smooth, append=smooth[:1])).max())
    return smooth * min(1.0, _MAX_PACE_CHANGE / max(steepest, 1e-12))


def _worthwhile_lead(reference: Array, features: Array) -> Array:
    """Lead of a loop over the reference at each sample [laps]: the smoothed warp, or zero if it gains little."""
    lead = _smooth_lead(_time_warp(reference, features))
    at = np.arange(_SAMPLES) + lead
    first = np.floor(at).astype(int)
    share = (at - first)[:, None]
    warped = (1.0 - share) * features[first % _SAMPLES] + share * features[(first + 1) % _SAMPLES]
    left, before = float(((warped - reference) ** 2).sum()), float(((features - reference) ** 2).sum())
    return lead / _SAMPLES if left < _MAX_MISMATCH_RATIO * before else np.zeros(_SAMPLES)


def aligned_channels(loops: list[Loop], samples: int, limbs: Sequence[Limb] = ()) -> Array:
    """Remainders of all loops at equal steps of the common phase.

    The first loop keeps its own phase; every other one is shifted and warped to it.

    Parameters
    ----------
    loops : list of Loop
        Clips as closed loops.
    samples : int
        N, phases 0, 1/N, … of the lap.
    limbs : sequence of Limb
        Limbs whose stance phases are aligned.

    Returns
    -------
    Array, shape (N, m, nq)
        Signs of quaternions agree with the first loop's as far as possible.
    """
    reference = _features(loops[0], limbs)
    phase = np.arange(samples) / samples
    channels = [loops[0].channels(phase, np.zeros(samples))]
    for loop in loops[1:]:
        features = _features(loop, limbs)
        shift = _best_shift(reference, features)
        lead = _worthwhile_lead(reference, np.roll(features, -shift, axis=0))
        knots = np.arange(_SAMPLES + 1) / _SAMPLES
        smooth = CubicSpline(knots, np.append(lead, lead[0]), bc_type="periodic")(phase)
        own = loop.channels(phase + shift / _SAMPLES + smooth, smooth)
        for first in range(3, own.shape[1], 4):
            if (own[:, first : first + 4] * channels[0][:, first : first + 4]).sum() < 0.0:
                own[:, first : first + 4] *= -1.0
        channels.append(own)
    return np.stack(channels, axis=1)
