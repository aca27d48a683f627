r"""Inverse kinematics of a limb that steps: near its singularities the foot gives way, so that no joint leaps.

A limb leaps where it snaps straight, where it folds up under its first joint, and where its last joint flips. With d
the distance of the last joint from the first, of a limb of length ℓ, and x = 1 + (d − (1 − b) ℓ) / (g ℓ), the foot
comes nearer by

.. math:: g\,\ell\,\bigl(x - x / (1 + x^3)^{1/3}\bigr), \qquad x > 0

so d stays short of (1 − b) ℓ, and to x = 0 three derivatives are continuous. A foot that comes too near to the first
joint goes by below it, at ½ + n³ − ½ n⁴ of where that begins for n of the distance there; one in mid-swing that turns
against its leg by almost half a turn goes back with it. b, g and the second are scaled by a share, 0 where a change
begins and ends: there the limb is as its motion has it.
"""

import numpy as np
from numba import njit

from controllers.easing import smooth_step
from controllers.legs.footsteps import FLOOR, lever, sole_height
from controllers.legs.limbs import AXIS, CENTRE, FIRST, LAST, LIMB, MIDDLE, OFFSETS, SHANK, THIGH, place_limb
from controllers.motion.vectors import cross, dot, product, turned_back, vector_at
from controllers.rotations import exponential, logarithm, multiply, relative
from controllers.state import Array, Pose
from controllers.work_array import work_array

_TOUCHES = 0.12  # [m] height from which a foot does not have to reach what it is asked for
_EASE = 0.95  # of its length, that a limb is long at ease
_BENT, _GIVES = 0.01, 0.1  # of its length, by which a limb stays short of straight, and from where on it gives way
_ROLL, _LEVER = 0.7, 0.15  # [rad] by which a sole rolls over its edge at most, [m] of height won by a radian
_AHEAD, _EDGE = 0.1, 0.02  # [m] by which the first joint is ahead where it does; over which its edge is rounded
_FINE = 2e-3  # [m]
_FOLDED = 0.55  # of its length, a distance from which on it is folded no further
_TWIST, _SWUNG = 1.8, 0.15  # [rad], [m] from which on a foot so high goes with its leg
_FARTHEST, _LOST = 0.5, 1.0  # of a limb's length, the way over the floor from which it is given up, and at which it is
_BACK = 0.04  # [rad] half of which a knee bends backwards at most, before it is bent as it has to be


@njit
def _bend_forwards(limb: Array, rotations: Array) -> None:
    """Take back what a limb's middle joint is bent backwards, all but a little: `place_limb` takes it for forwards.

    An angle α < 0 becomes α / (1 + (α/a)²), which leaves α = 0 with two derivatives alike.
    """
    q = rotations[int(limb[MIDDLE])]
    a, b, axis = vector_at(limb, THIGH), vector_at(limb, SHANK), vector_at(limb, AXIS)
    m = turned_back((q[0], q[1], q[2], q[3]), a)
    angle = np.arctan2(dot(m, cross(b, axis)), dot(m, b) - dot(m, axis) * dot(b, axis))
    if angle < 0.0:
        # Beyond −π/2 it is bent forwards by more than half a turn.
        wanted = angle / (1.0 + (angle / _BACK) ** 2) if angle > -0.5 * np.pi else -angle
        half = 0.5 * (wanted - angle)
        sine = np.sin(half)
        q[0], q[1], q[2], q[3] = product(
            (q[0], q[1], q[2], q[3]), (np.cos(half), sine * axis[0], sine * axis[1], sine * axis[2])
        )


@njit
def _leg(limb: Array, pose: Pose, end: Array, line: Array) -> float:
    """Write the way from a limb's first joint to its last, were its end at `end` (7,); returns its length, straight."""
    hip, longest = lever(limb, OFFSETS, pose), 0.0
    sole = lever(limb, CENTRE, end)
    for i in range(3):
        line[i] = end[i] - sole[i] - pose[i] - hip[i]
    for segment in (THIGH, SHANK):
        longest += np.sqrt(limb[segment] ** 2 + limb[segment + 1] ** 2 + limb[segment + 2] ** 2)
    return longest


@njit
def shortfall(limb: Array, step: Array, pose: Pose, end: Array) -> float:
    """How much lower the root must be for a limb to reach its end at ease, `end` (7,), if that is on the floor [m]."""
    line = work_array(3)
    longest = _EASE * _leg(limb, pose, end, line)
    way = np.sqrt(line[0] ** 2 + line[1] ** 2) / longest
    short = max(0.0, -line[2] - longest * np.sqrt(1.0 - min(way, _FARTHEST) ** 2))
    # For a foot that is left far behind the figure does not stoop.
    short *= 1.0 - min(max((way - _FARTHEST) / (_LOST - _FARTHEST), 0.0), 1.0) ** 2
    return short * smooth_step(1.0 - (sole_height(limb, end) - step[FLOOR]) / _TOUCHES)


@njit
def _roll(limb: Array, end: Array, along: Array, angle: float) -> None:
    """Roll a sole by an angle over its edge in a direction over the floor, (2,): that stays where it is, and as low."""
    low = sole_height(limb, end)
    point, total = work_array(2), 0.0
    point[:] = 0.0
    for k in range(LIMB, limb.shape[0], 3):
        x, y, _ = lever(limb, k, end)
        weight = np.exp((x * along[0] + y * along[1]) / _EDGE)
        total += weight
        point[0], point[1] = point[0] + weight * x, point[1] + weight * y
    away = (point[0] * along[0] + point[1] * along[1]) / total
    w, x, y, z = exponential(-angle * along[1], angle * along[0], 0.0)
    end[3], end[4], end[5], end[6] = multiply(w, x, y, z, end[3], end[4], end[5], end[6])
    for i in range(2):
        end[i] += (1.0 - np.cos(angle)) * away * along[i]
    end[2] += low - sole_height(limb, end)


@njit
def _hold_back(limb: Array, pose: Pose, end: Array, share: float) -> None:
    """Bring an end that a limb hardly reaches nearer to it, by a share that is 0 or up to 1: no knee snaps straight.

    It rolls over its edge first, such that a foot goes on to bear, and then it is drawn.
    """
    line, along = work_array(3), work_array(2)
    longest = _leg(limb, pose, end, line)
    distance = np.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
    room = max(_GIVES * share * longest, 1e-9)
    over = (distance - (1.0 - _BENT * share) * longest) / room + 1.0
    if over > 0.0:
        # x / (1 + x³)^(1/3) leaves the identity with two derivatives alike.
        back = room * over * (1.0 - 1.0 / np.cbrt(1.0 + over**3))
        way = np.sqrt(line[0] ** 2 + line[1] ** 2) + 1e-9
        for i in range(2):
            along[i] = -line[i] / way
        _roll(limb, end, along, smooth_step(way / _AHEAD) * _ROLL * np.tanh(back / (_ROLL * _LEVER)))
        wanted = distance - back
        _leg(limb, pose, end, line)
        distance = np.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
        # Rounded at zero, as far as it may be too near.
        back = distance - wanted
        back = 0.5 * (back + np.sqrt(back**2 + _FINE**2) - _FINE) / distance
        for i in range(3):
            end[i] -= back * line[i]
    # Nor folds up: what comes too near to the first joint goes by below it.
    least = _FOLDED * share * longest
    if 0.0 < distance < least:
        level = line[0] ** 2 + line[1] ** 2
        near = distance / least
        below = np.sqrt(max(((0.5 + near**3 * (1.0 - 0.5 * near)) * least) ** 2 - level, 0.0))
        end[2] += min(-below - line[2], 0.0)


@njit
def _turn_along(limb: Array, step: Array, rotations: Array, own: Array, end: Array) -> None:
    """Turn an end in mid-swing with its limb, where it would be turned almost half a turn from `own`, its joint's.

    Half a turn off no way round is the shorter one: the joint would flip. So nothing is left of that turn there.
    """
    swings = smooth_step((sole_height(limb, end) - step[FLOOR]) / _SWUNG)
    w, a, b, c = rotations[0]
    for joint in (limb[FIRST], limb[MIDDLE]):
        r = rotations[int(joint)]
        w, a, b, c = multiply(w, a, b, c, r[0], r[1], r[2], r[3])
    w, a, b, c = multiply(w, a, b, c, own[0], own[1], own[2], own[3])
    turn = logarithm(*relative(w, a, b, c, end[3], end[4], end[5], end[6]))
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle <= _TWIST:
        return
    wide = np.pi - _TWIST
    u = (angle - _TWIST) / wide
    kept = (1.0 - u) ** 2 * ((1.0 + 2.0 * u) * _TWIST + u * wide) + u * u * (1.0 - u) * wide
    share = 1.0 + swings * (kept / angle - 1.0)
    before = lever(limb, CENTRE, end)
    end[3:] = multiply(w, a, b, c, *exponential(share * turn[0], share * turn[1], share * turn[2]))
    after = lever(limb, CENTRE, end)
    for i in range(3):
        end[i] += after[i] - before[i]


@njit
def put_limb(limb: Array, step: Array, pose: Pose, end: Array, share: float) -> None:
    """Correct the joints of a limb such that its end, in a step, is where `end` (7,) says; `share` of `_hold_back`."""
    rotations, last = pose[3:].reshape(-1, 4), int(limb[LAST])
    _bend_forwards(limb, rotations)
    _hold_back(limb, pose, end, share)
    own = rotations[last].copy()
    # Once from a limb that is straight leaves up to two centimetres.
    for again in range(2):
        rotations[last] = end[3:]
        place_limb(limb, rotations, work_array((0, 3, 0)), pose[:3].reshape(1, 3), end[:3].reshape(1, 3), 0)
        if again == 0:
            _turn_along(limb, step, rotations, own, end)
