r"""Foot placement in a transition: feet step one after the other to their places in the new motion, without skate.

Let E_n(s) be the position of a limb's end (foot) in the new motion, and E_o(s) that in the old motion, brought to rest
within half of the blend time. The end follows

.. math:: E(s) = E_o + \beta(x)\,(E_n - E_o) + b(x)\,\lambda\,|E_n - E_o|\,e_z

with the smooth step β = 10 x³ − 15 x⁴ + 6 x⁵ and the arc b = 64 x³ (1 − x)³; orientations likewise on SO(3). x runs
from 0 to 1 in the limb's own half of the blend time, while the other foot is in stance. A foot in stance both before
and after the change is the pivot (`pivot`): the new motion is placed on the floor so that this foot coincides, and it
steps second, hardly moving. Without a pivot, the stance foot of the new motion steps first; else the foot that is
higher or has the longer way. So position, velocity and acceleration of the feet are continuous, a moving foot is
above the ground, and one foot is in stance. The limb's joints follow by inverse kinematics (`stepping_limbs`).

A limb is a row of `packed_steppers`: `Limb.packed`, then its sole points in the frame of the last segment.
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from controllers.legs.limbs import CENTRE, FIRST, LIMB_SIZE, OFFSETS, Limb
from controllers.legs.stance_hold import packed_soles
from controllers.motion.inertialization import decaying_offset, stopping_distance
from controllers.state import Pose
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.easing import smooth_step
from geometry.rotations import exponential, logarithm, multiply, relative, rotate
from geometry.vectors import Vector, vector_at

MAX_CONTINUED_ACCELERATION = 20.0
"""Largest linear acceleration of the old motion that is continued in a change, of the root and of feet [m/s²]: a hand
that is thrown plays its clip very fast. Half or twice this value for feet changes joint speeds by at most 1 rad/s in 8
ms in the changes and stops described at `_LIFT_RATIO`."""

# λ: height of a step over its length. In 40 changes and 40 stops of walk, run and squat dance (`change_trials`) joint
# speeds change by up to 25 and 36 rad/s in 8 ms; with half of it by 11 and 24, with twice by 94 and 48. Feet slide
# 2.9 cm in all three cases.
_LIFT_RATIO = 0.2
_TURN_LEVER = 0.1  # [m] lever that converts the turn of a foot to a step length: half the length of its sole
_ROUNDING_LENGTH = 3e-3  # [m] length of a step below which it is hardly lifted
# [m] feet whose heights differ by less count as equally high, since single poses have no speed
_HEIGHT_TOLERANCE = 0.01
# urgency of the step of a stance foot; above that of any other foot, which is 100 at a height of 1 m
_STANCE_URGENCY = 1e3
# [m] largest stopping distance of a foot, unless that needs less than the least stopping time. With half of it feet
# slide at most 1.3 cm in these changes instead of 2.9, and are at most 9 cm in the air in the stops instead of 12; with
# twice 17 cm.
_MAX_STOPPING_DISTANCE = 0.12
_MAX_ANGULAR_ACCELERATION = 100.0  # [rad/s²] as `MAX_CONTINUED_ACCELERATION`, for the rotation of a foot
# [s] least stopping time of a foot: half or twice it changes joint speeds in these changes by at most 2 rad/s in 8 ms.
_MIN_STOPPING_TIME = 0.05
# A row of `steps`: begin of the step [s]; position (3) and quaternion (4) at which the old motion comes to rest;
# offsets from there with rates, (3, 3) each, of position and orientation; stopping time [s]; height of the floor [m].
_BEGIN, _POSITION, _TURN, _SHIFT, _TURN_SHIFT, _STOP, FLOOR, STEP = 0, 1, 4, 8, 17, 26, 27, 28


def packed_steppers(limbs: Sequence[Limb]) -> Array:
    """Limbs packed for the kernels, shape (n, 36 + 3 k) for k sole points each.

    Raises
    ------
    ParameterError
        If the limbs differ in their number of points.
    """
    return np.hstack([[limb.packed() for limb in limbs], packed_soles(limbs).reshape(len(limbs), -1)])


@njit
def lever(limb: Array, at: int, segment: Array) -> Vector:
    """Vector ``limb[at:at + 3]`` of a segment with the pose `segment` (7 or more,), turned to the world frame [m]."""
    x, y, z = vector_at(limb, at)
    return rotate(segment[3], segment[4], segment[5], segment[6], x, y, z)


@njit
def sole_height(limb: Array, end: Array) -> float:
    """Height of the lowest sole point of a limb's end with pose `end` (7,) [m]."""
    least = np.inf
    for k in range(LIMB_SIZE, limb.shape[0], 3):
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
def _stopping_motion(values: Array, period: float, seconds: float, bound: float, rest: Array, change: Array) -> None:
    """Rest position `rest` (3,) of a motion, and its offset from there with rates, `change` (3, 3); both written.

    `values` (3, 3) are its samples now, a period before and a period after. Each component of its acceleration is
    limited to `bound`, so that a throw is not continued.
    """
    for i in range(3):
        change[1, i] = 0.5 * (values[2, i] - values[1, i]) / period
        gain = (values[2, i] - 2.0 * values[0, i] + values[1, i]) / period**2
        change[2, i] = min(max(gain, -bound), bound)
        change[0, i] = -stopping_distance(change[1, i], change[2, i], seconds)
        rest[i] = values[0, i] - change[0, i]


@njit
def _relative_turns(q: Array, ends: Array, turns: Array) -> None:
    """Write the rotation vectors (3, 3) from an orientation q (4,) to those of three poses (3, 7)."""
    for j in range(3):
        turns[j] = logarithm(*relative(q[0], q[1], q[2], q[3], ends[j, 3], ends[j, 4], ends[j, 5], ends[j, 6]))


@njit
def _end_heights(limbs: Array, pose: Pose, heights: Array) -> float:
    """Write the heights of the lowest points of the limbs' ends [m]; returns the least."""
    end = work_array(7)
    for n in range(limbs.shape[0]):
        limb_end(limbs[n], pose, end)
        heights[n] = sole_height(limbs[n], end)
    return heights.min()


@njit
def pivot(limbs: Array, shown: Pose, ahead: Array, stance: Array) -> tuple[int, int]:
    """Pivot of a change: the limb in stance both before and after it, −1 if there is none.

    A limb that is in stance in both poses of the new motion is preferred. If several limbs are equally good, there is
    no pivot.

    Parameters
    ----------
    limbs : Array, shape (n, 36 + 3 k)
        `packed_steppers`.
    shown : Pose
        Pose of the old motion at the change.
    ahead : Array, shape (2, nq)
        Poses of the new motion at the ends of the first and of the second step.
    stance : Array, shape (n,)
        Written: 1 where the limb is in stance in both poses of the new motion, else 0.

    Returns
    -------
    int, int
        Limb, and the last row of `ahead` in which it is in stance.
    """
    count = limbs.shape[0]
    heights, ground = np.empty((3, count)), np.inf
    for i, pose in enumerate((shown, ahead[0], ahead[1])):
        ground = min(ground, _end_heights(limbs, pose, heights[i]))
    low = heights < ground + _HEIGHT_TOLERANCE
    best_limb, row, best_score, equal = -1, 1, 0, 0
    for n in range(count):
        stance[n] = 1.0 if low[1, n] and low[2, n] else 0.0
        score = 0 if not low[0, n] else 2 * int(low[1, n]) + int(low[2, n])
        equal = 1 if score > best_score else equal + int(score == best_score)
        if score > best_score:
            best_limb, row, best_score = n, 1 if low[2, n] else 0, score
    return (-1, 1) if equal > 1 else (best_limb, row)


@njit
def plan_steps(
    limbs: Array, steps: Array, shown: Array, target: Pose, period: float, seconds: float, second: int, stance: Array
) -> None:
    """Write how the limbs' ends come to rest at a change, and the order of their steps.

    Parameters
    ----------
    limbs : Array, shape (n, 36 + 3 k)
        `packed_steppers`.
    steps : Array, shape (n, STEP)
        Written.
    shown : Array, shape (3, nq)
        Poses of the old motion now, a period before and after.
    target : Pose
        Pose of the new motion now.
    period, seconds : float
        Time between the samples, and the blend time T [s].
    second, stands
        The limb that steps second (−1: any), and the stance of the new motion, from `pivot`.
    """
    half = 0.5 * seconds
    ends, turns, rest = np.empty((3, 7)), np.empty((3, 3)), np.empty(3)
    urgency, heights = np.empty(limbs.shape[0]), np.empty(limbs.shape[0])
    ground = _end_heights(limbs, shown[0], heights)
    for n in range(limbs.shape[0]):
        step = steps[n]
        for j in range(3):
            limb_end(limbs[n], shown[j], ends[j])
        # A falling foot stops before it is lower than the stance foot.
        fall, height = 0.5 * (ends[1, 2] - ends[2, 2]) / period, heights[n] - ground
        stop = half if fall <= 0.0 else min(half, max(2.0 * height / fall, _MIN_STOPPING_TIME))
        # A fast foot stops within the largest stopping distance.
        speed = np.sqrt(np.sum((ends[1, :3] - ends[2, :3]) ** 2)) * 0.5 / period
        stop = min(stop, max(2.0 * _MAX_STOPPING_DISTANCE / max(speed, 1e-9), _MIN_STOPPING_TIME))
        step[_STOP], step[FLOOR] = stop, ground
        shift, change = step[_SHIFT:_TURN_SHIFT].reshape(3, 3), step[_TURN_SHIFT:_STOP].reshape(3, 3)
        _stopping_motion(ends[:, :3], period, stop, MAX_CONTINUED_ACCELERATION, step[_POSITION:_TURN], shift)
        _relative_turns(ends[0, 3:], ends, turns)
        _stopping_motion(turns, period, stop, _MAX_ANGULAR_ACCELERATION, rest, change)
        step[_TURN:_SHIFT] = multiply(ends[0, 3], ends[0, 4], ends[0, 5], ends[0, 6], *exponential(*vector_at(rest, 0)))
        # Again relative to the rest orientation, since rotation vectors do not add exactly.
        _relative_turns(step[_TURN:_SHIFT], ends, turns)
        _stopping_motion(turns, period, stop, _MAX_ANGULAR_ACCELERATION, rest, change)
        change[0] = turns[0]
        limb_end(limbs[n], target, ends[1])
        urgency[n] = np.floor(height / _HEIGHT_TOLERANCE) + np.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1])
        urgency[n] += _STANCE_URGENCY * stance[n]
        if n == second:
            urgency[n] = -np.inf
    for n in range(limbs.shape[0]):
        steps[n, _BEGIN] = 0.0 if n == np.argmax(urgency) else half


@njit
def step_end(limb: Array, step: Array, s: float, seconds: float, end: Array) -> None:
    """Replace the pose of an end in the new motion, `end` (7,), by that in its step, s seconds after the change."""
    stop = step[_STOP]
    x = min(max((s - step[_BEGIN]) / (0.5 * seconds), 0.0), 1.0)
    if x >= 1.0:
        return
    share = smooth_step(x)
    left, floor = work_array(3), min(step[FLOOR], sole_height(limb, end))
    # The remaining motion of the old swing counts as length of the step too, or the foot would scrape the floor.
    square = step[_SHIFT] ** 2 + step[_SHIFT + 1] ** 2
    decaying_offset(step[_SHIFT:_TURN_SHIFT].reshape(3, 3), stop, min(s, stop), left)
    for i in range(3):
        old = step[_POSITION + i] + left[i]
        ahead = end[i] - old
        square += ahead * ahead if i < 2 else 0.0
        end[i] = old + share * ahead
    decaying_offset(step[_TURN_SHIFT:_STOP].reshape(3, 3), stop, min(s, stop), left)
    w, a, b, c = multiply(
        step[_TURN], step[_TURN + 1], step[_TURN + 2], step[_TURN + 3], *exponential(left[0], left[1], left[2])
    )
    turn = logarithm(*relative(w, a, b, c, end[3], end[4], end[5], end[6]))
    end[3], end[4], end[5], end[6] = multiply(
        w, a, b, c, *exponential(share * turn[0], share * turn[1], share * turn[2])
    )
    square += _TURN_LEVER**2 * (turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    # Rounded at zero, where the square root has no derivative.
    lift = 64.0 * (x * (1.0 - x)) ** 3 * _LIFT_RATIO * (np.sqrt(square + _ROUNDING_LENGTH**2) - _ROUNDING_LENGTH)
    # Without this, a foot that comes down fast, or turns, would penetrate the floor.
    end[2] += max(0.0, floor - sole_height(limb, end)) + lift
