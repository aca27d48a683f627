"""Kernel of the lifted map, and its parameters: frames, neighbours and corrections of the clips, packed."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.blending.combination import (
    ClipsAt,
    Ground,
    Mixture,
    combine,
    figure_channels,
    figure_limbs,
    packed_figure,
    weight_groups,
)
from controllers.blending.pair_corrections import neighbouring_pairs, packed_pairs, pair_channels, pair_correction
from controllers.curves.cylinder import cylinder
from controllers.curves.splines import control_points, interpolate, periodic_interpolation
from controllers.haptic_map.lifting.cores import attract_to_core
from controllers.haptic_map.lifting.frames import PlacedClip, frames_at, interpolate_frames, lap_spline, packed_frames
from controllers.haptic_map.lifting.neighbours import SITE, near_clips, near_weights, packed_neighbours
from controllers.haptic_map.lifting.sites import box
from controllers.legs.floor import SOFTNESS
from controllers.legs.limb_ends import end_channels, end_lag, end_poses, grounds, lowest_of_limbs
from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.legs.stance_hold import mixing_degree, packed_soles
from controllers.motion.channels import normalise
from controllers.motion.lap import MEMORY
from controllers.saturation import soft_clamp
from controllers.work_array import work_array, work_integers
from geometry.arrays import Array, IntArray

_LAG_SAMPLES = 128  # samples of λ round the lap
_MAX_ROWS = 256  # largest number of rows of the corrections' table round the lap
_PAIR_SAMPLES = 24  # phases of the lap at which neighbouring clips are searched
(
    _R_LOW, _R_HIGH, _Z_LOW, _Z_HIGH, _MARGIN, _CLIPS, _LEGS_OF, _SHARE, _LAG_AT, _DRIFTS_AT, _FRAMES_AT, _NEAR_AT,
    _PAIRS_AT, _SOLES_AT, _FIGURE,
) = range(15)  # fmt: skip
_NO_OWNER = 0.0  # instead of 1 + the number of the clip that gives the legs: all joints are blended


@njit
def _write_lags(control: Array, limbs: int, angle: float, channels: int, value: Array, slope: Array) -> None:
    """Write λ of each limb, which all clips share, into the channels of the first clip."""
    s = angle * _LAG_SAMPLES / (2.0 * np.pi)
    row = min(int(s), _LAG_SAMPLES - 1)
    lags = slice(channels - N_END_CHANNELS * limbs + 3, channels, N_END_CHANNELS)
    rate = _LAG_SAMPLES / (2.0 * np.pi)
    interpolate(control[row * limbs :], limbs, s - row, rate, value[0, lags], slope[0, lags])


@njit
def clip_weights(params: Array, x: Array, chain: Array, near: IntArray, w: Array, changes: Array) -> tuple[float, int]:
    """Angle of the hand and number of nearby clips; writes `near`, weights w and their derivatives `changes` (3, m)."""
    radius, angle = cylinder(x, chain)
    r, r_slope = soft_clamp(radius, params[_R_LOW], params[_R_HIGH], params[_MARGIN])
    z, z_slope = soft_clamp(x[2], params[_Z_LOW], params[_Z_HIGH], params[_MARGIN])
    for k in range(6):
        chain[1, k] *= r_slope
        chain[2, k] *= z_slope
    total = near.shape[0]
    sites, slopes = work_array((total, SITE)), work_array((total, SITE))
    neighbours = params[int(params[_NEAR_AT]) :]
    count = near_clips(neighbours, angle, r, z, near, sites, slopes)
    place, change = work_array(2), work_array((3, 2))
    if not attract_to_core(r, z, sites[:count], slopes[:count], place, change):
        near_weights(neighbours, r, z, sites[:count], slopes[:count], w[:count], changes[:, :count])
        return angle, count
    count = near_clips(neighbours, angle, place[0], place[1], near, sites, slopes)
    near_weights(neighbours, place[0], place[1], sites[:count], slopes[:count], w[:count], changes[:, :count])
    for i in range(count):
        by_r, by_z = changes[1, i], changes[2, i]
        changes[0, i] += by_r * change[0, 0] + by_z * change[0, 1]
        for parameter in (1, 2):
            changes[parameter, i] = by_r * change[parameter, 0] + by_z * change[parameter, 1]
    return angle, count


@njit
def _assign_legs(owner: int, share: float, near: IntArray, count: int, w: Array, changes: Array) -> int:
    """Weights of both groups from those of group 1: group 0 is the owner's alone; group 1 is λ w, plus 1 − λ for it.

    Returns the number of clips, which includes the owner even if it is far from the hand.
    """
    at = 0
    while at < count and near[at] != owner:
        at += 1
    if at == count:
        near[at], w[1, at], count = owner, 0.0, count + 1
        for parameter in range(3):
            changes[1, parameter, at] = 0.0
    for i in range(count):
        w[0, i] = 0.0
        w[1, i] *= share
        for parameter in range(3):
            changes[0, parameter, i] = 0.0
            changes[1, parameter, i] *= share
    w[0, at] = 1.0
    w[1, at] += 1.0 - share
    return count


@njit
def lifted_map(params: Array, x: Array, memory: Array, pose: Array, jacobian: Array) -> None:
    """Kernel of `Lifted`: h(x), and h_*(x) unless `jacobian` has no rows."""
    total, chain, owner = int(params[_CLIPS]), work_array((3, 6)), int(params[_LEGS_OF]) - 1
    groups = 2 if owner >= 0 else 1  # the last group has the weights at the position of the hand
    near, w, changes = work_integers(total), work_array((groups, total)), work_array((groups, 3, total))
    angle, count = clip_weights(params, x, chain, near, w[groups - 1], changes[groups - 1])
    if owner >= 0:
        count = _assign_legs(owner, params[_SHARE], near, count, w, changes)
    figure = params[_FIGURE:]
    channels = figure_channels(figure)
    value, slope, drifts = work_array((count, channels)), work_array((count, channels)), work_array((count, 3))
    frames = params[int(params[_FRAMES_AT]) :]
    for i in range(count):
        interpolate_frames(frames, near[i], angle, value[i], slope[i])
        for k in range(3):
            drifts[i, k] = params[int(params[_DRIFTS_AT]) + 3 * near[i] + k]
    limbs = figure_limbs(figure)
    _write_lags(params[int(params[_LAG_AT]) :], limbs, angle, channels, value, slope)
    pairs = params[int(params[_PAIRS_AT]) :]
    d = work_array((4, pair_channels(pairs)))
    if d.shape[1] > 0:
        pair_correction(pairs, angle, near[:count], w[0, :count], changes[0, :, :count], d)
    contact, at = 0.0, int(params[_SOLES_AT])
    for i in range(count):
        contact += w[0, i] * params[at + 1 + near[i]]
    soles = params[at + 1 + total :].reshape(limbs, -1, 3) if limbs > 0 else work_array((0, 0, 3))
    mixture = Mixture(w[:, :count], changes[:, :, :count], chain, d)
    ground = Ground(memory[MEMORY:], mixing_degree(w[0, :count]), soles, contact, params[at])
    combine(figure, ClipsAt(value, slope, drifts), angle, mixture, memory[:MEMORY], ground, pose, jacobian)


def packed_lifted(clips: Sequence[PlacedClip], sites: Array, margin: float, limbs: Sequence[Limb]) -> Array:
    """Parameters of the kernel, with all joints blended; sites (rows, m, 2) and margin in [m], as in `Lifted`."""
    drifts, rotations = np.stack([clip.drift for clip in clips]), (clips[0].poses.shape[1] - 3) // 4
    lags = _common_lags(clips, drifts, rotations, limbs)
    channels = [_clip_channels(clip, lags, limbs) for clip in clips]
    splines = [lap_spline(clip.angles, c, rotations, clip.closed) for clip, c in zip(clips, channels, strict=True)]
    low, high = box(sites)
    half = 0.5 * margin
    rows = int(np.clip(max(len(clip.poses) for clip in clips), 64, _MAX_ROWS)) if limbs else 1
    blocks = [
        packed_figure(np.zeros(rotations, dtype=np.int64), limbs),
        control_points(lags, np.ones(lags.shape[1:])).ravel(),
        drifts.ravel(),
        packed_frames(splines),
        packed_neighbours(sites, (low[0] - half, high[0] + half), (low[1] - half, high[1] + half)),
        _packed_pairs(splines, drifts, lags, sites, rows, limbs),
        _packed_ground(channels, limbs),
    ]
    at = _FIGURE + np.cumsum([block.size for block in blocks[:-1]])
    numbers = [low[0], high[0], low[1], high[1], margin, len(clips), _NO_OWNER, 1.0, *at]
    return np.concatenate([np.array(numbers), *blocks])


def with_legs_of(params: Array, clip: int, upper: Sequence[int], share: float) -> Array:
    """Parameters of the same map with root and all joints but `upper` from one clip, and a share λ of the rest."""
    changed = params.copy()
    groups = weight_groups(changed[_FIGURE:])
    groups[:] = np.isin(np.arange(len(groups)), upper)
    changed[_LEGS_OF], changed[_SHARE] = 1.0 + clip, share
    return changed


def _clip_channels(clip: PlacedClip, lags: Array, limbs: Sequence[Limb]) -> Array:
    """Channels of a clip at its frames: the remainder, then each limb's end."""
    result, ends = clip.remainder[:, None], list[Array]()
    rest, lag = result.copy(), periodic_interpolation(lags, clip.angles)
    for n, limb in enumerate(limbs):
        quaternions, end = end_channels(rest, clip.drift[None], limb, lag[:, n])
        result[..., 3 + 4 * limb.joints[2] : 7 + 4 * limb.joints[2]] = quaternions
        ends.append(end)
    return np.concatenate([result, *ends], axis=2)[:, 0]


def _packed_ground(channels: list[Array], limbs: Sequence[Limb]) -> Array:
    if not limbs:
        return np.zeros(1 + len(channels))
    floor = min(lowest_of_limbs(clip[:, None], limbs, SOFTNESS).min() for clip in channels)
    return np.concatenate([[floor], *(grounds(clip[:, None], limbs) for clip in channels), packed_soles(limbs)])


def _packed_pairs(
    splines: list[tuple[Array, Array, Array]], drifts: Array, lags: Array, sites: Array, rows: int,
    limbs: Sequence[Limb],
) -> Array:  # fmt: skip
    """Corrections of in-betweens of neighbouring clips, a table of `rows` phases round the lap."""
    phases = np.arange(rows) * 2.0 * np.pi / rows
    channels = np.stack([frames_at(spline, phases) for spline in splines], axis=1)
    last = channels.shape[2] - N_END_CHANNELS * len(limbs)
    normalise(channels, (last - 3) // 4)
    for n in range(len(limbs)):
        channels[..., last + N_END_CHANNELS * n + 3] = periodic_interpolation(lags[:, n], phases)[:, None]
    steps = periodic_interpolation(sites, np.arange(_PAIR_SAMPLES) * 2.0 * np.pi / _PAIR_SAMPLES)
    return packed_pairs(channels, drifts, limbs, neighbouring_pairs(steps))


def _common_lags(clips: Sequence[PlacedClip], drifts: Array, rotations: int, limbs: Sequence[Limb]) -> Array:
    """λ of each limb at equal steps of the lap, shape (_LAG_SAMPLES, limbs), from all clips."""
    if not drifts[:, 2].any() or not limbs:
        return np.zeros((_LAG_SAMPLES, len(limbs)))
    phases = np.arange(_LAG_SAMPLES) * 2.0 * np.pi / _LAG_SAMPLES
    splines = [lap_spline(clip.angles, clip.remainder, rotations, clip.closed) for clip in clips]
    channels = np.stack([frames_at(spline, phases) for spline in splines], axis=1)
    return np.stack([end_lag(end_poses(channels, limb)[0], drifts) for limb in limbs], axis=1)
