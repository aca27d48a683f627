r"""Stance and swing of a blend: its feet step one at a time, and move only while they are lifted.

A mean of clips that step at different times moves both feet at once, hardly lifted. So at every mixture of the clips
the path of each foot over the lap is made again from what the mean asks for:

- Clearance. With the clearances h̄_j of the blended feet and F = Σ w_i min_j h_ij, the height at which the clips
  themselves fly, foot j is held at F + A(ĥ_j), ĥ_j = h̄_j − min_k h̄_k: the lower foot stands. A(h) = h + c h/(h + h_c)
  lifts a foot that makes a small share of a step enough for it to clear the ground.
- Place and heading. The foot moves as far as it is free, g = S((ĥ + F)/h_0), and catches up with the mean then:

.. math:: p' = g\, \dot{\bar p} + \kappa\, g\, (\bar p - p) .

  Integrated forwards round the lap this holds a foot where it last stood; integrated backwards, where it will stand
  next; their average does both by halves, and is as fixed while g = 0.

What is found at a mixture is lessened by the average of what is found for its clips alone, which so remain as they are.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.legs.limb_ends import contact_moves, lowest_point
from controllers.legs.limbs import END, Limb
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.loops import plane_exponential, turned, yawed
from controllers.state import Array

_SOFTNESS = 5e-4  # [m] of the minimum of a sole's heights
_FREE = 0.008  # h_0 [m], where the foot is lifted so high
STANDS, _SHARE_STANDS = 0.003, 0.2  # [m] so high it does not move yet, and as a share
_SHARE_FREE = 0.5  # and as a share of the largest lift of the lap
_LIFTED = 0.002  # [m] a foot that is never lifted more is not held
_RAISE, _RAISE_FROM = 0.02, 0.003  # c, h_c [m]
_CATCH_UP = 8.0  # κ ∫ g over a lap, at least
_FADE = 4  # power of a clip's weight with which its own slides come back
_LAPS = 4  # until the path repeats


class BlendedFeet(NamedTuple):
    """What the mean asks of J feet at k mixtures of m clips, at n samples of the lap.

    Attributes
    ----------
    height : Array, shape (n, k, J)
        Of the lowest point of each sole over the lowest of all clips [m].
    moves : Array, shape (n, k, J, 3)
        Over the ground (x, y [m], heading [rad]) at the points that touch, from each sample to the next.
    angles : Array, shape (n + 1, k, J)
        By which a foot's frame is turned [rad].
    own : Array, shape (n, m, J)
        Heights in the clips themselves [m].
    """

    height: Array
    moves: Array
    angles: Array
    own: Array


class MeanEnd(NamedTuple):
    """Where the mean has the end of a limb at k mixtures, at n samples of the lap.

    Attributes
    ----------
    place : Array, shape (n, k, 3)
        Of the centre of its points [m], in a frame of its own.
    turn : Array, shape (n, k, 4)
        Its orientation there.
    shift : Array, shape (n + 1, k, 2)
        Of that frame over the ground [m], a lap on at last.
    angle : Array, shape (n + 1, k)
        By which it is turned [rad].
    """

    place: Array
    turn: Array
    shift: Array
    angle: Array


def smooth_step(x: Array) -> Array:
    """C² step from 0 to 1 on [0, 1]."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def _raise(lift: Array) -> Array:
    return _RAISE * lift / (lift + _RAISE_FROM)


def _mean_rotations(quaternions: Array, weights: Array) -> Array:
    """Chordal means (n, k, 4) of rotations (n, m, 4) with weights (k, m); signs continuous along n."""
    n, m, _ = quaternions.shape
    squares = (quaternions[..., :, None] * quaternions[..., None, :]).reshape(n, m, 16)
    mean = np.linalg.eigh((weights @ squares).reshape(n, -1, 4, 4))[1][..., -1]
    dots = np.einsum("nkx,nkx->nk", mean[:-1], mean[1:])
    mean[1:] *= np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)[..., None]
    return mean


def gap(slips: Array, hold: Array, turn: Array) -> Array:
    """How far what slips is ahead of what stands, c' = slip − κ g c, forwards and backwards round the lap on average.

    Parameters
    ----------
    slips : Array, shape (n, ..., 3)
        Over the ground (x, y, heading) from each sample to the next.
    hold : Array, shape (n, ...)
        exp(−κ g Δs).
    turn : Array, shape (...)
        Angle by which the lap turns [rad].

    Returns
    -------
    Array, shape (n, ..., 3)
    """
    n, held = len(slips), hold[..., None]
    ahead, behind = np.empty_like(slips), np.empty_like(slips)
    front, back, angle = np.zeros_like(slips[0]), np.zeros_like(slips[0]), np.broadcast_to(turn, slips.shape[1:-1])
    for _ in range(_LAPS):
        for k in range(n):
            ahead[k] = front
            front = held[k] * front + slips[k]
        for k in range(n - 1, -1, -1):
            if k == n - 1:
                back[..., :2] = turned(angle, back[..., :2])
            back = held[k] * back - slips[k]
            behind[k] = back
        front[..., :2] = turned(-angle, front[..., :2])
    return 0.5 * (ahead + behind)


def foot_corrections(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> Array:
    """Corrections of a blend's ends at mixtures of its clips.

    Parameters
    ----------
    channels : Array, shape (n, m, nq + 5 limbs)
        Of the clips at equal steps of the lap (`with_ends`).
    drifts : Array, shape (m, 3)
        Their drifts ξ.
    limbs : sequence of Limb
    weights : Array, shape (k, m)
        Of the clips in each mixture.

    Returns
    -------
    Array, shape (n, k, 2 + 4 limbs)
        Channels of `inbetween`: those of the root zero.
    """
    everything = np.concatenate([weights, np.eye(channels.shape[1])])
    found = _found(channels, drifts, limbs, everything)
    own = found[:, len(weights) :]
    shares = own_shares(channels, weights)
    return found[:, : len(weights)] - np.einsum("km,nmc->nkc", shares, own)


def own_shares(channels: Array, weights: Array) -> Array:
    """How much of what clips slide alone a mixture keeps, shape (k, m); a clip that is given twice counts as one."""
    clips = range(channels.shape[1])
    alike = np.array([[np.array_equal(channels[:, i], channels[:, j]) for j in clips] for i in clips])
    return (weights @ alike) ** _FADE / alike.sum(axis=0)


def blended_feet(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> BlendedFeet:
    """What the mean asks of the feet; arguments as in `foot_corrections`."""
    own = np.stack([_own_height(channels, limbs, j) for j in range(len(limbs))], axis=2)
    ground = own.min()
    height, moves, angles = [], [], []
    for j, limb in enumerate(limbs):
        place, turn, shift, angle = mean_end(channels, drifts, limbs, j, weights)
        height.append(place[..., 2] + lowest_point(turn, limb, _SOFTNESS) - ground)
        place = np.concatenate([place, place[:1]])[..., :2]
        heading = np.unwrap(2.0 * np.arctan2(turn[..., 3], turn[..., 0]), axis=0)
        closing = heading[:1] + 2.0 * np.pi * np.round((heading[-1:] - heading[:1]) / (2.0 * np.pi))
        heading = np.concatenate([heading, closing]) + angle
        over_ground = yawed(angle, np.concatenate([turn, turn[:1]]))
        moves.append(contact_moves(turned(angle, place) + shift, over_ground, heading, limb, _SOFTNESS))
        angles.append(angle)
    return BlendedFeet(np.stack(height, axis=2), np.stack(moves, axis=2), np.stack(angles, axis=2), own - ground)


def _own_end(channels: Array, limbs: Sequence[Limb], j: int) -> tuple[Array, Array]:
    """Of the end of limb j in each clip: position, λ and clearance (n, m, 5), and orientation (n, m, 4)."""
    at, column = channels.shape[2] - END * (len(limbs) - j), 3 + 4 * limbs[j].joints[2]
    return channels[..., at : at + END], channels[..., column : column + 4]


def _own_height(channels: Array, limbs: Sequence[Limb], j: int) -> Array:
    end, turn = _own_end(channels, limbs, j)
    return end[..., 2] + lowest_point(turn, limbs[j], _SOFTNESS)


def mean_end(channels: Array, drifts: Array, limbs: Sequence[Limb], j: int, weights: Array) -> MeanEnd:
    """Where the mean has the end of limb j; arguments as in `foot_corrections`."""
    n = len(channels)
    ends, turns = _own_end(channels, limbs, j)
    lag = np.append(ends[:, 0, 3], ends[0, 0, 3])
    shift, angle = plane_exponential((np.arange(n + 1) / n + lag)[:, None, None] * (weights @ drifts))
    return MeanEnd(np.einsum("km,nmx->nkx", weights, ends[..., :3]), _mean_rotations(turns, weights), shift, angle)


def _found(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> Array:
    n = len(channels)
    feet = blended_feet(channels, drifts, limbs, weights)
    flight = np.einsum("km,nmj->nkj", weights, feet.own.min(axis=2, keepdims=True))
    own_raise = np.einsum("km,nmj->nkj", weights, _raise(feet.own - feet.own.min(axis=2, keepdims=True)))
    lift = feet.height - feet.height.min(axis=2, keepdims=True)
    raised = np.maximum(0.0, _raise(lift) - own_raise)
    up = flight + lift + raised
    highest = up.max(axis=0)
    least = np.minimum(STANDS, _SHARE_STANDS * highest)
    free = smooth_step((up - least) / np.maximum(np.minimum(_FREE, _SHARE_FREE * highest) - least, 1e-6))
    # A foot that the clips do not lift is left to the mean.
    held = smooth_step(highest / _LIFTED)
    free = 1.0 - held * (1.0 - free)
    rate = np.maximum(_CATCH_UP / np.maximum(free.mean(axis=0), 0.02), 60.0)
    slips = (1.0 - free)[..., None] * feet.moves
    ahead = gap(slips, np.exp(-rate * free / n), (weights @ drifts)[:, 2, None])
    result = np.zeros((n, len(weights), ROOT + FOOT * len(limbs)))
    for j in range(len(limbs)):
        at = ROOT + FOOT * j
        result[..., at : at + 2] = turned(-feet.angles[:-1, :, j], -ahead[:, :, j, :2])
        result[..., at + 2] = (up - feet.height)[..., j]
        result[..., at + 3] = -ahead[:, :, j, 2]
    return result
