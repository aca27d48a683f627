r"""Stance and swing of a blend: its feet step one at a time, and move only while they are lifted.

The mean of clips with different footsteps moves both feet at once, hardly lifted. So for every mixture of the clips the
path of each foot over the lap is computed anew from the mean path p̄:

- Clearance. With the clearances h̄_j of the feet in the mean and F = Σ w_i min_j h_ij, the mean height of the clips'
  flight phases, foot j is placed at z = F + ĥ_j + max(0, e(ĥ_j) − Σ w_i e(ĥ_ij)), ĥ_j = h̄_j − min_k h̄_k: the lower
  foot is in stance. e(h) = c h/(h + h_c) lifts a foot that makes only a small share of a step enough to clear the
  ground.
- Position and heading. The foot moves in proportion to g = S((z − h_s)/(h_0 − h_s)), 0 in stance and 1 in swing, and
  catches up with the mean meanwhile:

.. math:: p' = g\, \dot{\bar p} + \kappa\, g\, (\bar p - p) .

  Integrated forwards round the lap this holds a foot where it last stood; integrated backwards, where it will stand
  next. The average of both is used; it is equally fixed while g = 0.

From the correction of a mixture, the weighted corrections of its clips alone are subtracted, so that clips alone remain
unchanged.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.legs.limb_ends import SOFTMIN_WIDTH, contact_moves, lowest_point
from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.legs.sole_heights import STANCE_HEIGHT, SWING_HEIGHT
from controllers.motion.inbetween import FOOT, ROOT
from controllers.motion.loops import plane_exponential, rotate_in_plane
from geometry.arrays import Array
from geometry.easing import smooth_steps
from geometry.quaternions import about_axis, product, with_continuous_signs

_CATCH_UP = 8.0
"""Least κ ∫ g over a lap, after which e⁻⁸ of a gap is left. Half or twice this value changes the foot slide of blends
and of led captures by at most 0.1 mm."""

# Largest fractions of a foot's highest lift in the lap for h_s (`STANCE_HEIGHT`) and h_0 (`SWING_HEIGHT`). With
# half or twice h_0 a blend of cheer and ginga still slides 1.0 cm; a blend of walk, run, ginga and cheer, which no map
# blends as a whole, slides 2.3 or 0.8 cm in the median instead of 1.0.
_MAX_STANCE_FRACTION, _MAX_SWING_FRACTION = 0.2, 0.5
# [m] a foot whose highest lift in the lap is below this is held less, one that is never lifted not
_FULL_HOLD_LIFT = 0.002
# c, h_c [m]. With half or twice c the largest slide of a blend of cheer and ginga stays 1.0 cm; blends of walk, run,
# ginga and cheer slide 1.2 or 0.7 cm in the median instead of 1.0, and their soles sink 5 or 8 mm instead of 6.
_MAX_RAISE, _RAISE_SCALE = 0.02, 0.003
_SKATE_EXPONENT = 4  # power of a clip's weight that scales its own foot skate: a sixteenth of it remains half way
_INTEGRATION_LAPS = 4  # laps of integration until the path is periodic: each leaves e⁻⁸ of the error, all four 1e-14


class BlendedFeet(NamedTuple):
    """Paths of J feet in the mean, for k mixtures of m clips, at n samples of the lap.

    Attributes
    ----------
    height : Array, shape (n, k, J)
        Height of the lowest point of each sole above the lowest point of all clips [m].
    moves : Array, shape (n, k, J, 3)
        Slip over the ground (x, y [m], heading [rad]) at the touching points, from each sample to the next.
    angles : Array, shape (n + 1, k, J)
        Heading of the frame in which a foot is given [rad].
    own : Array, shape (n, m, J)
        Heights in the clips themselves [m].
    """

    height: Array
    moves: Array
    angles: Array
    own: Array


def _extra_clearance(lift: Array) -> Array:
    return _MAX_RAISE * lift / (lift + _RAISE_SCALE)


def _mean_rotations(quaternions: Array, weights: Array) -> Array:
    """Chordal means (n, k, 4) of rotations (n, m, 4) with weights (k, m); signs continuous along n."""
    n, m, _ = quaternions.shape
    squares = (quaternions[..., :, None] * quaternions[..., None, :]).reshape(n, m, 16)
    return with_continuous_signs(np.linalg.eigh((weights @ squares).reshape(n, -1, 4, 4))[1][..., -1])


def accumulated_slip(slips: Array, hold: Array, turn: Array) -> Array:
    """Accumulated slip c of a foot, c' = slip − κ g c: average of forward and backward integration round the lap.

    Parameters
    ----------
    slips : Array, shape (n, ..., 3)
        Slip over the ground (x, y, heading) from each sample to the next.
    hold : Array, shape (n, ...)
        exp(−κ g Δs).
    turn : Array, shape (...)
        Heading change of a lap [rad].

    Returns
    -------
    Array, shape (n, ..., 3)
    """
    n, decay = len(slips), hold[..., None]
    ahead, behind = np.empty_like(slips), np.empty_like(slips)
    front, back, angle = np.zeros_like(slips[0]), np.zeros_like(slips[0]), np.broadcast_to(turn, slips.shape[1:-1])
    for _ in range(_INTEGRATION_LAPS):
        for k in range(n):
            ahead[k] = front
            front = decay[k] * front + slips[k]
        for k in range(n - 1, -1, -1):
            if k == n - 1:
                back[..., :2] = rotate_in_plane(angle, back[..., :2])
            back = decay[k] * back - slips[k]
            behind[k] = back
        front[..., :2] = rotate_in_plane(-angle, front[..., :2])
    return 0.5 * (ahead + behind)


def foot_corrections(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> Array:
    """Corrections of a blend's ends at mixtures of its clips.

    Parameters
    ----------
    channels : Array, shape (n, m, nq + 4 limbs)
        Channels of the clips at equal steps of the lap (`with_ends`).
    drifts : Array, shape (m, 3)
        Drifts ξ of the clips.
    limbs : sequence of Limb
    weights : Array, shape (k, m)
        Weights of the clips in each mixture.

    Returns
    -------
    Array, shape (n, k, 2 + 4 limbs)
        Channels of `inbetween`, with zeros for the root.
    """
    all_weights = np.concatenate([weights, np.eye(channels.shape[1])])
    corrections = _mixture_corrections(channels, drifts, limbs, all_weights)
    own = corrections[:, len(weights) :]
    # A clip given twice counts as one.
    clips = range(channels.shape[1])
    equal = np.array([[np.array_equal(channels[:, i], channels[:, j]) for j in clips] for i in clips])
    shares = (weights @ equal) ** _SKATE_EXPONENT / equal.sum(axis=0)
    return corrections[:, : len(weights)] - np.einsum("km,nmc->nkc", shares, own)


def blended_feet(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> BlendedFeet:
    """Paths of the feet in the mean; arguments as in `foot_corrections`."""
    own = np.stack([_clip_sole_height(channels, limbs, j) for j in range(len(limbs))], axis=2)
    ground = own.min()
    height, moves, angles, n = [], [], [], len(channels)
    for j, limb in enumerate(limbs):
        ends, turns = _clip_end(channels, limbs, j)
        # The mean's frame moves over the ground with the drift exp((s + λ) ξ).
        lag = np.append(ends[:, 0, 3], ends[0, 0, 3])
        shift, angle = plane_exponential((np.arange(n + 1) / n + lag)[:, None, None] * (weights @ drifts))
        place, turn = np.einsum("km,nmx->nkx", weights, ends[..., :3]), _mean_rotations(turns, weights)
        height.append(place[..., 2] + lowest_point(turn, limb, SOFTMIN_WIDTH) - ground)
        place = np.concatenate([place, place[:1]])[..., :2]
        heading = np.unwrap(2.0 * np.arctan2(turn[..., 3], turn[..., 0]), axis=0)
        closing = heading[:1] + 2.0 * np.pi * np.round((heading[-1:] - heading[:1]) / (2.0 * np.pi))
        heading = np.concatenate([heading, closing]) + angle
        over_ground = product(about_axis(2, angle), np.concatenate([turn, turn[:1]]))
        moves.append(contact_moves(rotate_in_plane(angle, place) + shift, over_ground, heading, limb))
        angles.append(angle)
    return BlendedFeet(np.stack(height, axis=2), np.stack(moves, axis=2), np.stack(angles, axis=2), own - ground)


def _clip_end(channels: Array, limbs: Sequence[Limb], j: int) -> tuple[Array, Array]:
    """End of limb j in each clip: position and λ (n, m, 4), and orientation (n, m, 4)."""
    at, column = channels.shape[2] - N_END_CHANNELS * (len(limbs) - j), 3 + 4 * limbs[j].joints[2]
    return channels[..., at : at + N_END_CHANNELS], channels[..., column : column + 4]


def _clip_sole_height(channels: Array, limbs: Sequence[Limb], j: int) -> Array:
    end, turn = _clip_end(channels, limbs, j)
    return end[..., 2] + lowest_point(turn, limbs[j], SOFTMIN_WIDTH)


def _mixture_corrections(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array) -> Array:
    n = len(channels)
    feet = blended_feet(channels, drifts, limbs, weights)
    flight = np.einsum("km,nmj->nkj", weights, feet.own.min(axis=2, keepdims=True))
    own_raise = np.einsum("km,nmj->nkj", weights, _extra_clearance(feet.own - feet.own.min(axis=2, keepdims=True)))
    lift = feet.height - feet.height.min(axis=2, keepdims=True)
    raised = np.maximum(0.0, _extra_clearance(lift) - own_raise)
    up = flight + lift + raised
    highest = up.max(axis=0)
    stance = np.minimum(STANCE_HEIGHT, _MAX_STANCE_FRACTION * highest)
    free = smooth_steps(
        (up - stance) / np.maximum(np.minimum(SWING_HEIGHT, _MAX_SWING_FRACTION * highest) - stance, 1e-6)
    )
    # A foot that the clips do not lift follows the mean.
    hold = smooth_steps(highest / _FULL_HOLD_LIFT)
    free = 1.0 - hold * (1.0 - free)
    rate = np.maximum(_CATCH_UP / np.maximum(free.mean(axis=0), 0.02), 60.0)
    slips = (1.0 - free)[..., None] * feet.moves
    ahead = accumulated_slip(slips, np.exp(-rate * free / n), (weights @ drifts)[:, 2, None])
    result = np.zeros((n, len(weights), ROOT + FOOT * len(limbs)))
    for j in range(len(limbs)):
        at = ROOT + FOOT * j
        result[..., at : at + 2] = rotate_in_plane(-feet.angles[:-1, :, j], -ahead[:, :, j, :2])
        result[..., at + 2] = (up - feet.height)[..., j]
        result[..., at + 3] = -ahead[:, :, j, 2]
    return result
