r"""Removal of foot skate from motion captures: in each stance a sole keeps one place on the floor, or rolls on it.

Captured feet slide, hover over the floor and sink into it by centimetres. These errors are removed smoothly from the
stance phases of each foot's path, which is otherwise little changed. With h, which is 1 in stance and 0 in swing, and
g, which is 1 in swing and 0 in stance, both C² and never positive together:

- The phase of the foot's frame (s + λ, see `led`) advances at the rate g, so that it is exactly constant in stance.
- Position and heading are p = p̄ − c, with p̄ the captured ones and the slip c' = h p̄' − κ g c. Integrated forwards
  round the lap this holds a foot where it landed, backwards where it will lift off; the average of both is taken.
- The foot is turned about its length until its breadth is level, since a foot on one corner turns and creeps. Of the
  slope β of its length β³/(β² + β_0²) remains, so that a foot that rolls from heel to toes lies flat in between.
  Otherwise contact would change from heel to toes within a hundredth of a second, and a physical foot that lags behind
  by a degree would stand on neither.
- In stance its captured height is subtracted, in swing a smooth transition between the median heights of the two
  neighbouring stances. In swing its height over the floor is at least h_0.

The root is lowered by as much as the legs would be too short otherwise.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from controllers.curves.splines import round_lap
from controllers.easing import smooth_steps
from controllers.legs.cyclic_runs import runs
from controllers.legs.footfalls import CATCH_UP, gap
from controllers.legs.limb_ends import SHARP, contact_moves, end_channels, lowest_point
from controllers.legs.limbs import END, Limb
from controllers.legs.reaching import reached, shortfall
from controllers.motion.channels import signed_like
from controllers.motion.loops import plane_exponential, turned, yawed
from controllers.state import Array, Mask

# Share of a swing at each end over which g rises: half of it, or half a swing, changes the slide of eight led
# captures (of the animation) by 0.3 cm at most, and their knees not.
_SWING_EDGE = 0.35
_STANCE_EDGE = 0.01  # share of a stance at each end over which h rises: feet touch down and lift off with a small slip
# Share of a stance at each end, and at most [s], in which its height settles: without the latter feet hover by a
# millimetre or two for 0.1 s and bear nothing. With half of that time knees of led captures accelerate by up to 2690
# rad/s² instead of 1040, with twice by 1050.
_LEVEL_EDGE, _LEVEL_SECONDS = 0.15, 0.03
# Share of a swing at each end over which the least clearance is reached: the animation of the worst of eight led
# captures slides 3.0 cm, 1.5 with half of it and 7.5 with twice; their knees accelerate by up to 1040, 1090 and 980
# rad/s².
_LIFT_EDGE = 0.12
# [m] smoothing of a maximum of heights: half or twice changes the slide of led captures by 0.4 cm at most.
_SMOOTH = 0.0025
# h_0 [m], least height of a foot in swing: the worst of eight led captures slides 3.0 cm, with half of it 4.4, with
# twice 2.4.
_CLEAR = 0.01
_NARROW = 0.02  # [m] an end of less breadth is not levelled
_LYING, _UPRIGHT = 0.7, 0.95  # vertical component of an end's length from which it is levelled less, and not at all
# β_0 [rad]: ankles of eight led captures accelerate by up to 950 rad/s², with half of it 1280, with twice 800.
_FLAT = 0.05


def window(mask: Mask, rise: float, longest: float = np.inf) -> Array:
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
    channels: Array, drift: Array, limb: Limb, stands: Mask, radius: float, duration: float
) -> tuple[Array, Array]:
    """Orientation and channels of a limb's end without skate in stance; see `limb_ends.end_channels`.

    Parameters
    ----------
    channels : Array, shape (n, nq)
        Remainder of the clip at equal steps of the lap.
    drift : Array, shape (3,)
        Drift ξ of the clip.
    limb : Limb
    stands : array of bool, shape (n,)
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
    n, stays, free = len(channels), window(stands, _STANCE_EDGE), window(~stands, _SWING_EDGE)
    if stands.all() or not stands.any():
        # Without swing, or without stance, the phase advances uniformly.
        free = np.ones(n)
    lag = (np.cumsum(free) - 0.5 * free) / free.sum() - (np.arange(n) + 0.5) / n
    lag -= lag.mean()
    turns, parts = end_channels(channels[:, None], drift[None], limb, lag)
    quaternions, ends = _level(turns[:, 0], limb, 1.0 - free), parts[:, 0]
    heights = ends[:, 2] + lowest_point(quaternions, limb, SHARP) - radius
    # Over the ground, for one lap: the last sample is the first one a lap later.
    shift, angle = plane_exponential((np.arange(n + 1) / n + np.append(lag, lag[0]))[:, None] * drift)
    places = turned(angle, np.concatenate([ends[:, :2], ends[:1, :2]])) + shift
    # First the heading, then the position, since the roll of a foot depends on its heading.
    for kept in ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)):
        over_ground = yawed(angle, np.concatenate([quaternions, quaternions[:1]]))
        heading = np.unwrap(2.0 * np.arctan2(over_ground[:, 3], over_ground[:, 0]))
        moves = contact_moves(places[:, None], over_ground[:, None], heading[:, None], limb)[:, 0]
        ahead = kept * gap(stays[:, None] * moves, np.exp(-CATCH_UP * free / free.sum()), drift[2])
        ends[:, :2] -= turned(-angle[:-1], ahead[:, :2])
        quaternions = yawed(-ahead[:, 2], quaternions)
    level = levels(heights, stands)
    low = (1.0 - window(stands, _LEVEL_EDGE, _LEVEL_SECONDS * n / duration)) * _above(0.0, heights - level)
    ends[:, 2] += low + window(~stands, _LIFT_EDGE) * (_above(_CLEAR, low) - low) - heights
    return quaternions, ends


def _level(quaternions: Array, limb: Limb, share: Array) -> Array:
    """Orientations of an end (n, 4), levelled by a share (n,): its breadth, and its length if nearly level.

    See the module.
    """
    _, sizes, axes = np.linalg.svd(limb.points - limb.points.mean(axis=0))
    if len(sizes) < 2 or sizes[1] < _NARROW:
        return quaternions
    turn = Rotation.from_quat(quaternions, scalar_first=True)
    length, breadth = turn.apply(axes[0]), turn.apply(axes[1])
    tilt = np.arctan2(breadth[:, 2], np.cross(length, breadth)[:, 2])
    tilt -= np.pi * np.round(tilt / np.pi)
    # An end whose length is nearly vertical is not levelled.
    lies = smooth_steps((_UPRIGHT - np.abs(length[:, 2])) / (_UPRIGHT - _LYING))
    slope = np.arctan2(length[:, 2], np.hypot(length[:, 0], length[:, 1]))
    across = np.cross(length, [0.0, 0.0, 1.0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    down = slope * _FLAT**2 / (slope**2 + _FLAT**2)
    rolls, lays = ((-share * lies * angle)[:, None] * axis for angle, axis in ((tilt, length), (down, across)))
    levelled = Rotation.from_rotvec(lays) * Rotation.from_rotvec(rolls) * turn
    return signed_like(levelled.as_quat(scalar_first=True), quaternions)


def levels(heights: Array, stands: Mask) -> Array:
    """Height of a foot's stance [m], shape (n,): in a stance its median, in between a smooth step to the next."""
    n, level = len(heights), np.zeros(len(heights))
    stances = runs(stands)
    for (start, end), (following, last) in zip(stances, [*stances[1:], *stances[:1]], strict=True):
        here, there = (np.median(heights[np.arange(a, b) % n]) for a, b in ((start, end), (following, last)))
        swing = (following - end) % n
        level[np.arange(start, end) % n] = here
        level[np.arange(end, end + swing) % n] = here + (there - here) * smooth_steps((np.arange(swing) + 0.5) / swing)
    return level


def _above(least: float, heights: Array) -> Array:
    """Smooth maximum of heights and `least` [m], rounded over some millimetres."""
    return 0.5 * (heights + least + np.hypot(heights - least, _SMOOTH))


def with_planted_ends(  # noqa: PLR0913 - a clip, its limbs and its lap, each of which is needed
    rows: Array,
    channels: Array,
    drift: Array,
    limbs: Sequence[Limb],
    stands: Mask,
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
    stands : array of bool, shape (n, limbs)
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
    result[:, :2] += round_lap(sway, 2.0 * np.pi * np.arange(len(rows)) / len(rows))
    for j, limb in enumerate(limbs):
        at, column = first + END * j, 3 + 4 * limb.joints[2]
        quaternions, ends = planted_ends(channels, drift, limb, stands[:, j], radius, duration)
        result[:, column : column + 4], result[:, at : at + END] = quaternions, ends
        short.append(shortfall(result, stride, limb, at))
    # By a constant: vertical motion of the root would change the ground reaction forces.
    result[:, 2] -= np.max(short)
    return reached(result, stride, limbs)
