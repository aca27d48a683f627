r"""Foot placement in a transition: feet step to where the new motion has them, one after the other, and do not slide.

With E_n(s) where the end of a limb is in the new motion, and E_o(s) where it was, coming to rest within half of the
blend time, the end goes

.. math:: E(s) = E_o + \beta(x)\,(E_n - E_o) + b(x)\,\lambda\,|E_n - E_o|\,e_z

with the smooth step β = 10 x³ − 15 x⁴ + 6 x⁵ and the arc b = 64 x³ (1 − x)³; orientations likewise on SO(3). x runs
from 0 to 1 in the limb's own half of the blend time, and the other foot stands meanwhile. A foot that stands before the
change and after it is the pivot (`pivot`): the new motion is placed where it has that foot, which steps second, and
then hardly. Where there is none, the foot that the new motion stands on steps first; else the one that is higher, or
has the longer way to go. So position, velocity and acceleration of the feet are continuous, a foot that moves does so
above the ground, and one foot stands. The limb's joints follow (`stepping_limbs`).

A limb is a row of `packed_steppers`: `Limb.packed`, then its points as the last segment has them.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.easing import smooth_step
from controllers.legs.footing import packed_soles
from controllers.legs.limbs import CENTRE, FIRST, LIMB, OFFSETS, Limb
from controllers.motion.inertialization import offset_left, stopping_way
from controllers.motion.vectors import Vector
from controllers.rotations import exponential, logarithm, multiply, relative, rotate
from controllers.state import Array, Pose
from controllers.work_array import work_array

_LIFT = 0.2  # λ: height of a step over its length
_TURN_ARM = 0.1  # [m] a foot that turns moves as if its toes went this far a radian
_ROUND = 3e-3  # [m] a way so short is hardly worth a lift
_LEVEL = 0.01  # [m] feet that differ by less in height are equally high
_FIRST = 1e3  # urgency of the step to where a limb is stood on; another's is below it
_CAUGHT = 0.12  # [m] on which a foot comes to rest at most, unless it is too fast for that
_THROW, _TWIRL = 20.0, 100.0  # [m/s²], [rad/s²] with which it goes on to do so at most
_SOONEST = 0.05  # [s] in which a foot that falls comes to rest at least
# A row of `steps`: when the step begins, place and orientation where the old motion comes to rest, and the offsets
# from there with their rates, (3, 3) each; the time to get there; and the height of the floor.
_BEGIN, _PLACE, _TURN, _AWAY, _TURNED, _STOP, FLOOR, STEP = 0, 1, 4, 8, 17, 26, 27, 28


def packed_steppers(limbs: Sequence[Limb]) -> Array:
    """Limbs that step, as the kernels take them: shape (n, 36 + 3 k) for k points each.

    Raises
    ------
    ParameterError
        If one has more points than another.
    """
    return np.hstack([[limb.packed() for limb in limbs], packed_soles(limbs).reshape(len(limbs), -1)])


@njit
def lever(limb: Array, at: int, segment: Array) -> Vector:
    """Vector ``limb[at:at + 3]`` in the world [m]; it is given in the frame of a segment at `segment` (7 or more,)."""
    return rotate(segment[3], segment[4], segment[5], segment[6], limb[at], limb[at + 1], limb[at + 2])


@njit
def sole_height(limb: Array, end: Array) -> float:
    """Height of the lowest point of a limb's end [m], which is at `end` (7,)."""
    least = np.inf
    for k in range(LIMB, limb.shape[0], 3):
        least = min(least, lever(limb, k, end)[2])
    return end[2] + least


@njit
def limb_end(limb: Array, pose: Pose, end: Array) -> None:
    """Position of the centre of a limb's end in the world [m] and its orientation (wxyz), written to `end` (7,)."""
    end[:] = pose[:7]
    for i in range(3):
        at = 3 + 4 * int(limb[FIRST + i])
        x, y, z = lever(limb, OFFSETS + 3 * i, end)
        end[0], end[1], end[2] = end[0] + x, end[1] + y, end[2] + z
        end[3], end[4], end[5], end[6] = multiply(
            end[3], end[4], end[5], end[6], pose[at], pose[at + 1], pose[at + 2], pose[at + 3]
        )
    x, y, z = lever(limb, CENTRE, end)
    end[0], end[1], end[2] = end[0] + x, end[1] + y, end[2] + z


@njit
def _come_to_rest(values: Array, period: float, seconds: float, most: float, rest: Array, change: Array) -> None:
    """Where a motion with samples (3, 3) now, a period before and after comes to rest; offset from there and rates.

    Of its acceleration no more is taken than `most`: what is thrown does not go on to be.
    """
    for i in range(3):
        change[1, i] = 0.5 * (values[2, i] - values[1, i]) / period
        gain = (values[2, i] - 2.0 * values[0, i] + values[1, i]) / period**2
        change[2, i] = min(max(gain, -most), most)
        change[0, i] = -stopping_way(change[1, i], change[2, i], seconds)
        rest[i] = values[0, i] - change[0, i]


@njit
def _heights(limbs: Array, pose: Pose, heights: Array) -> float:
    """Heights of the lowest points of the ends of limbs [m], written; returns the least."""
    end = work_array(7)
    for n in range(limbs.shape[0]):
        limb_end(limbs[n], pose, end)
        heights[n] = sole_height(limbs[n], end)
    return heights.min()


@njit
def pivot(limbs: Array, shown: Pose, ahead: Array, stands: Array) -> tuple[int, int]:
    """The limb on which a figure stands both before and after a change, −1 if there is none, and when after.

    One on which the new motion stands throughout comes first. With all of them there is none to choose.

    Parameters
    ----------
    limbs : Array, shape (n, 36 + 3 k)
        `packed_steppers`.
    shown : Pose
        Of the old motion at the change.
    ahead : Array, shape (2, nq)
        Poses of the new motion when the first step ends, and when the second does.
    stands : Array, shape (n,)
        Written: 1 where the new motion stands on the limb in both poses, else 0.

    Returns
    -------
    int, int
        Limb, and the row of `ahead` in which it stands (the last one).
    """
    count = limbs.shape[0]
    heights, ground = np.empty((3, count)), np.inf
    for i, pose in enumerate((shown, ahead[0], ahead[1])):
        ground = min(ground, _heights(limbs, pose, heights[i]))
    low = heights < ground + _LEVEL
    found, row, best, equal = -1, 1, 0, 0
    for n in range(count):
        stands[n] = 1.0 if low[1, n] and low[2, n] else 0.0
        score = 0 if not low[0, n] else 2 * int(low[1, n]) + int(low[2, n])
        equal = 1 if score > best else equal + int(score == best)
        if score > best:
            found, row, best = n, 1 if low[2, n] else 0, score
    return (-1, 1) if equal > 1 else (found, row)


@njit
def plan_steps(
    limbs: Array, steps: Array, shown: Array, asked: Pose, period: float, seconds: float, second: int, stands: Array
) -> None:
    """Note how the ends of limbs move at a change, and which of two steps first.

    Parameters
    ----------
    limbs : Array, shape (n, 36 + 3 k)
        `packed_steppers`.
    steps : Array, shape (n, STEP)
        Written.
    shown : Array, shape (3, nq)
        Poses of the old motion now, a period before and after.
    asked : Pose
        Of the new motion now.
    period, seconds : float
        Between the samples, and the blend time T [s].
    second, stands
        The limb that steps second, −1 for any, and those that the new motion stands on, as `pivot` tells.
    """
    half = 0.5 * seconds
    ends, turns, way = np.empty((3, 7)), np.empty((3, 3)), np.empty(3)
    urgency, heights = np.empty(limbs.shape[0]), np.empty(limbs.shape[0])
    ground = _heights(limbs, shown[0], heights)
    for n in range(limbs.shape[0]):
        step = steps[n]
        for j in range(3):
            limb_end(limbs[n], shown[j], ends[j])
        # Not deeper than the foot that stands.
        fall, height = 0.5 * (ends[1, 2] - ends[2, 2]) / period, heights[n] - ground
        stop = half if fall <= 0.0 else min(half, max(2.0 * height / fall, _SOONEST))
        # Nor farther than a leg in full swing can be caught.
        speed = np.sqrt(np.sum((ends[1, :3] - ends[2, :3]) ** 2)) * 0.5 / period
        stop = min(stop, max(2.0 * _CAUGHT / max(speed, 1e-9), _SOONEST))
        step[_STOP], step[FLOOR] = stop, ground
        _come_to_rest(ends[:, :3], period, stop, _THROW, step[_PLACE:_TURN], step[_AWAY:_TURNED].reshape(3, 3))
        w, x, y, z = ends[0, 3], ends[0, 4], ends[0, 5], ends[0, 6]
        for j in range(3):
            turns[j] = logarithm(*relative(w, x, y, z, ends[j, 3], ends[j, 4], ends[j, 5], ends[j, 6]))
        change = step[_TURNED:_STOP].reshape(3, 3)
        _come_to_rest(turns, period, stop, _TWIRL, way, change)
        step[_TURN:_AWAY] = multiply(w, x, y, z, *exponential(way[0], way[1], way[2]))
        # Seen from where it rests, exactly: rotations do not add.
        w, x, y, z = step[_TURN], step[_TURN + 1], step[_TURN + 2], step[_TURN + 3]
        for j in range(3):
            turns[j] = logarithm(*relative(w, x, y, z, ends[j, 3], ends[j, 4], ends[j, 5], ends[j, 6]))
        _come_to_rest(turns, period, stop, _TWIRL, way, change)
        change[0] = turns[0]
        limb_end(limbs[n], asked, ends[1])
        urgency[n] = np.floor(height / _LEVEL) + np.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1])
        urgency[n] += _FIRST * stands[n]
        if n == second:
            urgency[n] = -np.inf
    for n in range(limbs.shape[0]):
        steps[n, _BEGIN] = 0.0 if n == np.argmax(urgency) else half


@njit
def step_end(limb: Array, step: Array, s: float, seconds: float, end: Array) -> None:
    """Move an end of the new motion, `end` (7,), to where it is s seconds after the change, in its step."""
    stop = step[_STOP]
    x = min(max((s - step[_BEGIN]) / (0.5 * seconds), 0.0), 1.0)
    if x >= 1.0:
        return
    share = smooth_step(x)
    left, floor = work_array(3), min(step[FLOOR], sole_height(limb, end))
    # What the old motion still carries it counts too: a foot in mid-swing would scrape.
    way = step[_AWAY] ** 2 + step[_AWAY + 1] ** 2
    offset_left(step[_AWAY:_TURNED].reshape(3, 3), stop, min(s, stop), left)
    for i in range(3):
        old = step[_PLACE + i] + left[i]
        ahead = end[i] - old
        way += ahead * ahead if i < 2 else 0.0
        end[i] = old + share * ahead
    offset_left(step[_TURNED:_STOP].reshape(3, 3), stop, min(s, stop), left)
    w, a, b, c = multiply(
        step[_TURN], step[_TURN + 1], step[_TURN + 2], step[_TURN + 3], *exponential(left[0], left[1], left[2])
    )
    turn = logarithm(*relative(w, a, b, c, end[3], end[4], end[5], end[6]))
    end[3], end[4], end[5], end[6] = multiply(
        w, a, b, c, *exponential(share * turn[0], share * turn[1], share * turn[2])
    )
    way += _TURN_ARM**2 * (turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    # Rounded at zero, where a root has no derivative.
    lift = 64.0 * (x * (1.0 - x)) ** 3 * _LIFT * (np.sqrt(way + _ROUND**2) - _ROUND)
    # A foot that comes down fast, or turns, would go through the floor.
    end[2] += max(0.0, floor - sole_height(limb, end)) + lift
