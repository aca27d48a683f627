r"""Clips with limbs given by their end effectors (feet): position, orientation and height above the ground.

In a blend, a turning clip would drag the stance feet of the others round with it. So the ends do not move with the
steady drift exp(s ξ) of the lap (`loops`) but with exp((s + λ(s)) ξ), which rests during stance and advances during
swing. λ, the lag, is common to all clips, and has no effect unless some clip turns.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.errors import ParameterError
from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.motion.loops import plane_exponential, rotate_in_plane
from geometry.arrays import Array
from geometry.quaternions import about_axis, product, with_continuous_signs

SOFTMIN_WIDTH = 5e-4
"""Softness of the minimum of sole heights when feet are planted or the ground is estimated [m]: four points at equal
height count as 0.7 mm (ln 4 times the softness) lower."""

_GROUND_QUANTILE = 0.02  # fraction of its frames in which a clip may be below the ground estimated from it


def end_poses(channels: Array, limb: Limb) -> tuple[Array, Array]:
    """Positions (n, m, 3) and orientations (n, m, 4) of a limb's end in remainders (n, m, nq)."""
    n, m, numbers = channels.shape
    if max(limb.joints) > (numbers - 7) // 4:
        raise ParameterError(f"the poses have {(numbers - 7) // 4} joints, a limb needs {limb.joints}")
    place, turn = channels[..., :3].reshape(-1, 3), _joint_rotations(channels, 0)
    for joint, offset in zip(limb.joints, limb.offsets, strict=True):
        place = place + turn.apply(offset)
        turn = turn * _joint_rotations(channels, joint)
    place = place + turn.apply(limb.points.mean(axis=0))
    quaternions = turn.as_quat(scalar_first=True).reshape(n, m, 4)
    return place.reshape(n, m, 3), with_continuous_signs(quaternions)


def lowest_point(quaternions: Array, limb: Limb, softness: float) -> Array:
    """Height of a limb's lowest point over the centre of its points, a soft minimum; orientations (..., 4)."""
    turn = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
    heights = np.stack([turn.apply(point)[:, 2] for point in limb.points - limb.points.mean(axis=0)])
    return (-softness * np.log(np.exp(-heights / softness).sum(axis=0))).reshape(quaternions.shape[:-1])


def contact_moves(places: Array, quaternions: Array, headings: Array, limb: Limb) -> Array:
    """Slip of an end over the ground from each sample to the next, at the touching points, so that a foot may roll.

    Parameters
    ----------
    places : Array, shape (n, k, 2)
        Positions of the centre of the limb's points, over the ground [m].
    quaternions : Array, shape (n, k, 4)
        Orientations of the end over the ground.
    headings : Array, shape (n, k)
        Their headings [rad], continuous along n.
    limb : Limb

    Returns
    -------
    Array, shape (n - 1, k, 3)
        Displacement (x, y) of the points, weighted towards the lowest (`SOFTMIN_WIDTH`), without the part due to the
        turn about the vertical, [m]; and that turn [rad].
    """
    turn = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
    offsets = limb.points - limb.points.mean(axis=0)
    levers = np.stack([turn.apply(p).reshape(*headings.shape, 3) for p in offsets], axis=-2)
    weights = np.exp((levers[..., 2].min(axis=-1, keepdims=True) - levers[..., 2]) / SOFTMIN_WIDTH)
    weights /= weights.sum(axis=-1, keepdims=True)
    share, lever = 0.5 * (weights[1:] + weights[:-1])[..., None], 0.5 * (levers[1:] + levers[:-1])
    turning = np.diff(headings, axis=0)
    swept = turning[..., None, None] * np.stack([-lever[..., 1], lever[..., 0]], axis=-1)
    rolled = (share * (np.diff(levers[..., :2], axis=0) - swept)).sum(axis=-2)
    return np.concatenate([np.diff(places, axis=0) + rolled, turning[..., None]], axis=-1)


def _joint_rotations(channels: Array, joint: int) -> Rotation:
    return Rotation.from_quat(channels[..., 3 + 4 * joint : 7 + 4 * joint].reshape(-1, 4), scalar_first=True)


def end_lag(places: Array, drifts: Array, weights: Array | None = None) -> Array:
    r"""λ of an end at equal steps of the lap, from its velocity v over the ground.

    .. math:: \frac{d\lambda}{ds} = \frac{|v|^2}{\langle|v|^2\rangle} - 1, \qquad \langle\lambda\rangle = 0

    It falls with slope −1 in stance, and rises again in swing.

    Parameters
    ----------
    places : Array, shape (n, m, 3)
        Positions of the end in the remainders of m clips [m].
    drifts : Array, shape (m, 3)
        Drifts ξ of the clips.
    weights : Array, shape (m,), optional
        Weight of each clip; by default its turn |ω| per lap, since λ matters to a blend only if a clip turns.

    Returns
    -------
    Array, shape (n,)
    """
    n = len(places)
    weights = np.abs(drifts[:, 2]) if weights is None else weights
    if not weights.any():
        return np.zeros(n)
    rate = 0.5 * n * (np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0))[..., :2]
    across = np.stack([-places[..., 1], places[..., 0]], axis=-1)
    # The velocity over the ground is that of the drift plus that in the frame of the drift.
    square = ((rate + drifts[:, :2] + drifts[:, 2:] * across) ** 2).sum(axis=2)
    pace = square / np.maximum(square.mean(axis=0), 1e-12)
    pace = pace @ weights / weights.sum()
    lag = (np.cumsum(pace) - 0.5 * pace - np.arange(n) - 0.5) / n
    return lag - lag.mean()


def end_channels(channels: Array, drifts: Array, limb: Limb, lag: Array) -> tuple[Array, Array]:
    """Orientation and channels of a limb's end.

    Parameters
    ----------
    channels : Array, shape (n, m, nq)
        Remainders of m clips at n phases.
    drifts : Array, shape (m, 3)
        Drifts ξ of the clips.
    limb : Limb
    lag : Array, shape (n,)
        λ at the phases.

    Returns
    -------
    quaternions : Array, shape (n, m, 4)
        Orientations of the end, in the frame that moves by exp(λ ξ).
    ends : Array, shape (n, m, 4)
        Position of the end in that frame (3) [m], and λ.

    Raises
    ------
    ParameterError
        If the poses lack a joint of the limb.
    """
    place, quaternions = end_poses(channels, limb)
    shift, angle = plane_exponential(lag[:, None, None] * drifts)
    place[..., :2] = rotate_in_plane(-angle, place[..., :2] - shift)
    lags = np.broadcast_to(lag[:, None, None], (*place.shape[:2], 1))
    return product(about_axis(2, -angle), quaternions), np.concatenate([place, lags], axis=2)


def with_ends(channels: Array, drifts: Array, limbs: Sequence[Limb], weights: Array | None = None) -> Array:
    """Channels with limbs given by their ends.

    Parameters
    ----------
    channels : Array, shape (n, m, nq)
        Remainders of m aligned loops at equal steps of the lap (see `alignment`).
    drifts : Array, shape (m, 3)
        Drifts ξ of the loops.
    limbs : sequence of Limb
    weights : Array, shape (m,), optional
        Of the loops in λ (`end_lag`).

    Returns
    -------
    Array, shape (n, m, nq + 4 limbs)
        The quaternion of each limb's last joint is replaced by the end's orientation; appended are, limb by limb, the
        end's position and λ.

    Raises
    ------
    ParameterError
        If the poses lack a joint of a limb.
    """
    result, ends = channels.copy(), list[Array]()
    for limb in limbs:
        lag = end_lag(end_poses(channels, limb)[0], drifts, weights)
        quaternions, end = end_channels(channels, drifts, limb, lag)
        column = 3 + 4 * limb.joints[2]
        result[..., column : column + 4] = quaternions
        ends.append(end)
    return np.concatenate([result, *ends], axis=2)


def lowest_of_limbs(channels: Array, limbs: Sequence[Limb], softness: float) -> Array:
    """Height of the lowest point of all limbs [m], with a soft minimum over the points of each limb.

    Parameters
    ----------
    channels : Array, shape (n, m, nq + 4 limbs)
        From `with_ends`.
    limbs : sequence of Limb
        At least one.
    softness : float
        Softness of the minimum [m].

    Returns
    -------
    Array, shape (n, m)
    """
    first, heights = channels.shape[2] - N_END_CHANNELS * len(limbs), list[Array]()
    for n, limb in enumerate(limbs):
        column = 3 + 4 * limb.joints[2]
        low = lowest_point(channels[..., column : column + 4], limb, softness)
        heights.append(channels[..., first + N_END_CHANNELS * n + 2] + low)
    return np.min(heights, axis=0)


def grounds(channels: Array, limbs: Sequence[Limb]) -> Array:
    """Height of the ground on which each clip stands [m], shape (m,): the 2 % quantile over its frames.

    `channels` and `limbs` are as in `lowest_of_limbs`.
    """
    return np.quantile(lowest_of_limbs(channels, limbs, SOFTMIN_WIDTH), _GROUND_QUANTILE, axis=0)
