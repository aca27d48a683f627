"""Blends of aligned loops: their channels as uniform cubic B-splines round the lap, combined with weights."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.blending.alignment import aligned_channels
from controllers.blending.combination import (
    SIGNED,
    ClipsAt,
    Ground,
    Mixture,
    combine,
    figure_channels,
    figure_limbs,
    figure_size,
    packed_figure,
)
from controllers.borrowed import without_refcount
from controllers.curves.splines import control_points, interpolate
from controllers.legs.limb_ends import grounds, with_ends
from controllers.legs.limbs import Limb
from controllers.legs.stance_hold import mixing_degree, packed_soles
from controllers.motion.channels import closing_signs
from controllers.motion.lap import MEMORY
from controllers.motion.loops import Loop
from controllers.work_array import work_array
from geometry.arrays import Array, IntArray

_SAMPLES, _CLIPS, _DRIFTS = range(3)
_SOLE_NUMBERS, _CLIPS_AT = range(2)  # of the ground
# Cosines of half the angle between two rotations of a joint, between which it is blended by `signed_mean`: from 168° on
# the other mean swings over to the heavier clip; beyond 277°, of joints that go round, this one is three times as fast.
_MAX_COSINE, _MIN_COSINE = 0.1, -0.75


@njit(forceinline=True)
def _interpolate(rows: Array, samples: int, clips: int, angle: float, value: Array, slope: Array) -> None:
    """Channels of each clip and their derivatives by the angle."""
    channels = value.shape[1]
    s, rate = angle * samples / (2.0 * np.pi), samples / (2.0 * np.pi)
    row = min(int(s), samples - 1)
    for clip in range(clips):
        first = (row * clips + clip) * channels
        interpolate(rows[first:], clips * channels, s - row, rate, value[clip], slope[clip])


@njit
def blend(
    params: Array, angle: float, weights: Array, changes: Array, chain: Array, memory: Array, pose: Array,
    jacobian: Array,
) -> None:  # fmt: skip
    """Blended pose, and its derivative unless `jacobian` has no rows.

    Parameters
    ----------
    params : Array
        `packed_blend`.
    angle, weights, changes, chain, memory, pose, jacobian
        As in `combine`; in the memory a footing may follow (`fresh_footing`), by which ends keep their places.
    """
    blend_corrected(params, angle, Mixture(weights, changes, chain, work_array((4, 0))), memory, pose, jacobian)


@njit(forceinline=True)
def blend_corrected(params: Array, angle: float, mixture: Mixture, memory: Array, pose: Array, jacobian: Array) -> None:
    """`blend` with a correction, see `combine`."""
    samples, clips = int(params[_SAMPLES]), int(params[_CLIPS])
    drifts = params[_DRIFTS : _DRIFTS + 3 * clips].reshape(clips, 3)
    figure = params[_DRIFTS + 3 * clips :]
    channels = figure_channels(figure)
    value, slope = work_array((clips, channels)), work_array((clips, channels))
    ground = figure[figure_size(figure) :]
    rows = ground[_ground_size(ground, clips) :]
    _interpolate(without_refcount(rows), samples, clips, angle, value, slope)
    held = _held_ground(ground, mixture.weights[0], figure_limbs(figure), memory[MEMORY:])
    combine(figure, ClipsAt(value, slope, drifts), angle, mixture, memory[:MEMORY], held, pose, jacobian)


@njit
def _ground_size(ground: Array, clips: int) -> int:
    return _CLIPS_AT + 2 * clips + int(ground[_SOLE_NUMBERS])


@njit
def _held_ground(ground: Array, weights: Array, limbs: int, footing: Array) -> Ground:
    """The ground of `_packed_ground` if the memory has a footing; no floor, below which corrections leave no foot."""
    if footing.shape[0] == 0:
        return Ground(footing, 0.0, work_array((0, 0, 3)), 0.0, 0.0)
    clips, contact = len(weights), 0.0
    total = work_array(clips)
    total[:] = 0.0
    for i in range(clips):
        contact += weights[i] * ground[_CLIPS_AT + i]
        total[int(ground[_CLIPS_AT + clips + i])] += weights[i]
    at = _CLIPS_AT + 2 * clips
    soles = ground[at : at + int(ground[_SOLE_NUMBERS])].reshape(limbs, -1, 3)
    return Ground(footing, mixing_degree(total), soles, contact, -np.inf)


def packed_blend(loops: list[Loop], samples: int, groups: IntArray, limbs: Sequence[Limb]) -> Array:
    """Parameters of `blend`: the loops, aligned in time to the first, as splines through equal steps of the lap.

    Parameters
    ----------
    loops : list of Loop
        Clips as closed loops.
    samples : int
        Number of samples of a lap.
    groups : IntArray, shape (1 + joints,)
        Group of weights that blends the root and each joint.
    limbs : sequence of Limb
        Limbs whose ends are blended; their joints belong to group 0.

    Raises
    ------
    ParameterError
        If a limb has a joint that the poses do not have.
    """
    drifts = np.stack([loop.drift for loop in loops])
    channels = with_ends(aligned_channels(loops, samples, limbs), drifts, limbs)
    closing, in_limbs = closing_signs(channels, len(groups)), [joint for limb in limbs for joint in limb.joints]
    groups = groups + SIGNED * _pass_half_turn(channels, closing, [0, *in_limbs], len(groups))
    rows = control_points(channels, closing).ravel()
    ground = _packed_ground(channels, limbs)
    return np.concatenate([[samples, len(loops)], drifts.ravel(), packed_figure(groups, limbs), ground, rows])


def _packed_ground(channels: Array, limbs: Sequence[Limb]) -> Array:
    """Of each clip the height at which it stands and the number of the first clip that is the same, then the soles."""
    clips = channels.shape[1]
    first = [next(j for j in range(i + 1) if np.array_equal(channels[:, j], channels[:, i])) for i in range(clips)]
    heights, soles = grounds(channels, limbs) if limbs else np.zeros(clips), packed_soles(limbs)
    return np.concatenate([[len(soles)], heights, first, soles])


def _pass_half_turn(channels: Array, closing: Array, without: Sequence[int], count: int) -> IntArray:
    """1 for each joint whose rotations in two clips come near half a turn apart, 0 for others and for those left out.

    In place, its quaternions get the signs in which they are nearest to the joint's zero.
    """
    passing = np.zeros(count, dtype=np.int64)
    for joint in sorted({*range(count)}.difference(without)):
        at = slice(3 + 4 * joint, 7 + 4 * joint)
        signs = np.where(channels[:, :, at.start].sum(axis=0) < 0.0, -1.0, 1.0)[:, None]
        unit = signs * channels[:, :, at] / np.linalg.norm(channels[:, :, at], axis=-1, keepdims=True)
        cosine = float(np.einsum("nik,njk->nij", unit, unit).min())
        if _MIN_COSINE < cosine < _MAX_COSINE and (closing[:, at] > 0.0).all():
            passing[joint] = 1
            channels[:, :, at] *= signs
    return passing
