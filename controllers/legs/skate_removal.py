r"""Removal of foot skate from motion captures: in each stance a sole keeps one place on the floor, or rolls on it.

Captured feet slide, hover over the floor and sink into it by centimetres. These errors are removed smoothly from the
stance phases of each foot's path, which is otherwise little changed. With h, which is 1 in stance and 0 in swing, and
g, which is 1 in swing and 0 in stance, both C² and never positive together:

- The phase of the foot's frame (s + λ, see `led`) advances at the rate g, so that it is exactly constant in stance.
- Position and heading are p = p̄ − c, with p̄ the captured ones and the slip c' = h p̄' − κ g c. Integrated forwards
  round the lap this holds a foot where it landed, backwards where it will lift off; the average of both is used.
- The foot is turned about its length until its breadth is level, since a foot on one corner turns and creeps. The
  slope β of its length is reduced to β³/(β² + β_0²), so that a foot that rolls from heel to toes lies flat in between.
  Otherwise contact would change from heel to toes within a hundredth of a second, and a physical foot that lags behind
  by a degree would rest on neither.
- Its captured height is subtracted in stance; in swing, a smooth transition between the median heights of the two
  neighbouring stances is subtracted. In swing its height over the floor is at least h_0.

The root is lowered until the legs are long enough.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.curves.splines import periodic_interpolation
from controllers.legs.cyclic_runs import runs
from controllers.legs.footfalls import CATCH_UP, accumulated_slip
from controllers.legs.limb_ends import SOFTMIN_WIDTH, contact_moves, end_channels, lowest_point
from controllers.legs.limbs import N_END_CHANNELS, Limb
from controllers.legs.reaching import shortfall, solve_reach
from controllers.motion.channels import signed_like
from controllers.motion.loops import plane_exponential, rotate_in_plane
from geometry.arrays import Array, Mask
from geometry.easing import smooth_steps
from geometry.quaternions import about_axis, product

# Fraction of a swing at each end over which g rises. Half of it, or half a swing, changes the foot slide of eight led
# captures (in the animation) by at most 0.3 cm, and does not change their knees.
_SWING_EDGE_FRACTION = 0.35
# fraction of a stance at each end over which h rises: feet touch down and lift off with a small slip
_STANCE_EDGE_FRACTION = 0.01
# Fraction of a stance at each end, and longest time [s], in which its height settles. Without the time limit feet hover
# by one or two millimetres for 0.1 s and bear no load. With half of that time knees of led captures accelerate by up to
# 2690 rad/s² instead of 1040, with twice by 1050.
_SETTLING_RATIO, _MAX_SETTLING_TIME = 0.15, 0.03
# Fraction of a swing at each end over which the least clearance is reached. The worst of eight led captures slides 3.0
# cm in the animation, with half of it 1.5 and with twice 7.5; knees accelerate by up to 1040, 1090 and 980 rad/s².
_LIFT_EDGE_FRACTION = 0.12
# [m] smoothing of a maximum of heights: half or twice it changes the slide of led captures by at most 0.4 cm.
_SMOOTHING_HEIGHT = 0.0025
# h_0 [m], least height of a foot in swing: the worst of eight led captures slides 3.0 cm, with half of it 4.4 and with
# twice 2.4.
_MIN_CLEARANCE = 0.01
_MIN_BREADTH = 0.02  # [m] an end that is narrower is not levelled
# vertical component of an end's length axis above which it is levelled less, and not at all
_LYING_COMPONENT, _UPRIGHT_COMPONENT = 0.7, 0.95
# β_0 [rad]: ankles of eight led captures accelerate by up to 950 rad/s², with half of it by 1280, with twice by 800.
_FLAT_SLOPE = 0.05


def smooth_mask(mask: Mask, rise: float, longest: float = np.inf) -> Array:
    """Smooth version of a cyclic mask: 0 outside its runs, 1 within, rising over a share of each run at its ends; C².

    The rise takes at most `longest` samples.
    """
    n, result = len(mask), np.zeros(len(mask))
    for start, end in runs(mask):
        samples = np.arange(start, end)
        edge = np.minimum(samples - start + 0.5, end - samples - 0.5)
        result[samples % n] = smooth_steps(edge / min(rise * (end - start), longest))
    return np.ones(n) if mask.all() else result


def planted_ends(
    channels: Array, drift: Array, limb: Limb, stance: Mask, radius: float, duration: float
) -> tuple[Array, Array]:
    """Orientation and channels of a limb's end without skate in stance; see `limb_ends.end_channels`.

    Parameters
    ----------
    channels : Array, shape (n, nq)
        Remainder of the clip at equal steps of the lap.
    drift : Array, shape (3,)
        Drift ξ of the clip.
    limb : Limb
    stance : array of bool, shape (n,)
        Samples at which the limb is in stance.
    radius : float
        Height of the sole points over the floor in stance [m].
    duration : float
        Duration of the lap [s].

    Returns
    -------
    quaternions : Array, shape (n, 4)
        Orientations of the end.
    ends : Array, shape (n, 4)
        Position (3) and λ.
    """
    n = len(channels)
    hold = smooth_mask(stance, _STANCE_EDGE_FRACTION)
    free = smooth_mask(~stance, _SWING_EDGE_FRACTION)
    if stance.all() or not stance.any():
        # Without swing, or without stance, the phase advances uniformly.
        free = np.ones(n)
    lag = (np.cumsum(free) - 0.5 * free) / free.sum() - (np.arange(n) + 0.5) / n
    lag -= lag.mean()
    turns, all_ends = end_channels(channels[:, None], drift[None], limb, lag)
    quaternions, ends = _level_end(turns[:, 0], limb, 1.0 - free), all_ends[:, 0]
    heights = ends[:, 2] + lowest_point(quaternions, limb, SOFTMIN_WIDTH) - radius
    # Over the ground, for one lap: the last sample is the first one a lap later.
    shift, angle = plane_exponential((np.arange(n + 1) / n + np.append(lag, lag[0]))[:, None] * drift)
    places = rotate_in_plane(angle, np.concatenate([ends[:, :2], ends[:1, :2]])) + shift
    # First the heading, then the position, since the roll of a foot depends on its heading.
    for mask in ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)):
        over_ground = product(about_axis(2, angle), np.concatenate([quaternions, quaternions[:1]]))
        heading = np.unwrap(2.0 * np.arctan2(over_ground[:, 3], over_ground[:, 0]))
        moves = contact_moves(places[:, None], over_ground[:, None], heading[:, None], limb)[:, 0]
        ahead = mask * accumulated_slip(hold[:, None] * moves, np.exp(-CATCH_UP * free / free.sum()), drift[2])
        ends[:, :2] -= rotate_in_plane(-angle[:-1], ahead[:, :2])
        quaternions = product(about_axis(2, -ahead[:, 2]), quaternions)
    level = levels(heights, stance)
    low = (1.0 - smooth_mask(stance, _SETTLING_RATIO, _MAX_SETTLING_TIME * n / duration)) * _soft_max(
        0.0, heights - level
    )
    ends[:, 2] += low + smooth_mask(~stance, _LIFT_EDGE_FRACTION) * (_soft_max(_MIN_CLEARANCE, low) - low) - heights
    return quaternions, ends


def _level_end(quaternions: Array, limb: Limb, share: Array) -> Array:
    """Orientations of an end (n, 4), levelled by a fraction (n,): its breadth, and its length if nearly level.

    See the module's docstring.
    """
    _, sizes, axes = np.linalg.svd(limb.points - limb.points.mean(axis=0))
    if len(sizes) < 2 or sizes[1] < _MIN_BREADTH:
        return quaternions
    turn = Rotation.from_quat(quaternions, scalar_first=True)
    length, breadth = turn.apply(axes[0]), turn.apply(axes[1])
    tilt = np.arctan2(breadth[:, 2], np.cross(length, breadth)[:, 2])
    tilt -= np.pi * np.round(tilt / np.pi)
    # An end whose length is nearly vertical is not levelled.
    weight = smooth_steps((_UPRIGHT_COMPONENT - np.abs(length[:, 2])) / (_UPRIGHT_COMPONENT - _LYING_COMPONENT))
    slope = np.arctan2(length[:, 2], np.hypot(length[:, 0], length[:, 1]))
    across = np.cross(length, [0.0, 0.0, 1.0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    excess = slope * _FLAT_SLOPE**2 / (slope**2 + _FLAT_SLOPE**2)
    rolls, pitches = ((-share * weight * angle)[:, None] * axis for angle, axis in ((tilt, length), (excess, across)))
    levelled = Rotation.from_rotvec(pitches) * Rotation.from_rotvec(rolls) * turn
    return signed_like(levelled.as_quat(scalar_first=True), quaternions)


def levels(heights: Array, stance: Mask) -> Array:
    """Stance height of a foot [m], shape (n,): in a stance its median, in between a smooth step to the next."""
    n, level = len(heights), np.zeros(len(heights))
    stances = runs(stance)
    for (start, end), (following, last) in zip(stances, [*stances[1:], *stances[:1]], strict=True):
        here, there = (np.median(heights[np.arange(a, b) % n]) for a, b in ((start, end), (following, last)))
        swing = (following - end) % n
        level[np.arange(start, end) % n] = here
        level[np.arange(end, end + swing) % n] = here + (there - here) * smooth_steps((np.arange(swing) + 0.5) / swing)
    return level


def _soft_max(least: float, heights: Array) -> Array:
    """Smooth maximum of heights and `least` [m], rounded over a few millimetres."""
    return 0.5 * (heights + least + np.hypot(heights - least, _SMOOTHING_HEIGHT))


def with_planted_ends(  # noqa: PLR0913 - a clip, its limbs and its lap, each of which is needed
    rows: Array,
    channels: Array,
    drift: Array,
    limbs: Sequence[Limb],
    stance: Mask,
    radius: float,
    duration: float,
    stride: float,
    sway: Array,
) -> Array:
    """Rows of a led clip without foot skate, with the root low enough for the legs to reach.

    Parameters
    ----------
    rows : Array, shape (n, nq + 4 limbs)
        Channels at equal steps of the lap: remainder, then each limb's end, as in the clip.
    channels : Array, shape (n, nq)
        The remainder, with the limbs' own joints.
    drift : Array, shape (3,)
        ξ of the clip, along x.
    limbs : sequence of Limb
    stance : array of bool, shape (n, limbs)
        Which limbs are in stance.
    radius : float
        Height of their sole points over the floor in stance [m].
    duration : float
        Duration of the lap [s].
    stride : float
        Length of a lap [m]; if shorter than the clip's, each step is shortened in proportion.
    sway : Array, shape (m, 2)
        Displacement of the root over the floor [m], at m equal steps of the lap.
    """
    first, result, short = channels.shape[1], rows.copy(), list[Array]()
    result[:, 0] *= stride / drift[0]
    result[:, :2] += periodic_interpolation(sway, 2.0 * np.pi * np.arange(len(rows)) / len(rows))
    for j, limb in enumerate(limbs):
        at, column = first + N_END_CHANNELS * j, 3 + 4 * limb.joints[2]
        quaternions, ends = planted_ends(channels, drift, limb, stance[:, j], radius, duration)
        result[:, column : column + 4], result[:, at : at + N_END_CHANNELS] = quaternions, ends
        short.append(shortfall(result, stride, limb, at))
    # By a constant: vertical motion of the root would change the ground reaction forces.
    result[:, 2] -= np.max(short)
    return solve_reach(result, stride, limbs)
