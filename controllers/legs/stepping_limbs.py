r"""Inverse kinematics of a stepping limb: near singularities the foot target is moved, so that no joint jumps.

Joints jump where the limb snaps straight, and where it folds up under its first joint. With d the distance of the last
joint from the first, ℓ the length of the limb, and x = 1 + (d − (1 − b) ℓ) / (g ℓ), the foot is drawn nearer by

.. math:: g\,\ell\,\bigl(x - x / (1 + x^3)^{1/3}\bigr), \qquad x > 0

so d stays below (1 − b) ℓ, with a C³ onset at x = 0. A foot too near to the first joint is moved below it, to the
distance ½ + n³ − ½ n⁴ from the first joint for an original distance n, both in units of the distance at which this
begins. b, g and the folding distance are scaled by a factor that is 0 at the beginning and end of a change, where the
limb stays as in its motion.
"""

import numpy as np
from numba import njit

from controllers.legs.footsteps import FLOOR, lever, sole_height
from controllers.legs.limb_kinematics import solve_limb
from controllers.legs.limbs import AXIS, CENTRE, LAST, LIMB_SIZE, MIDDLE, OFFSETS, SHANK, THIGH
from controllers.state import Pose
from controllers.work_array import work_array
from geometry.arrays import Array
from geometry.easing import smooth_step
from geometry.rotations import exponential, multiply
from geometry.vectors import cross, dot, product, turned_back, vector_at

_MAX_LOWERING_HEIGHT = 0.12  # [m] height of a foot above which the root is not lowered to reach it
# Extension of a limb over its length above which the root is lowered: a knee bent by 36°. With 0.9 and 0.98 the
# height of feet changes by 1 mm in the median of 40 changes, and their slide does not.
_EASY_EXTENSION_RATIO = 0.95
# b and g, in lengths of the limb. In the median of 40 changes of walk, run and squat dance, feet are 11 mm in the air,
# with half of g 5 and with twice 21; joint speeds change by 3.4, 2.7 and 5.4 rad/s in 8 ms. Half or twice b changes the
# height by 2 mm.
_MIN_SHORTENING_RATIO, _ONSET_RATIO = 0.01, 0.1
# [rad] largest roll of a sole over its edge; [m] gain of reach per radian. In 40 changes of walk, run and squat dance
# soles hardly roll: half or twice the first changes nothing.
_MAX_ROLL, _ROLL_LEVER = 0.7, 0.15
# [m] horizontal offset of the first joint for a full roll; [m] rounding of the sole's edge
_ROLL_OFFSET, _EDGE_ROUNDING = 0.1, 0.02
_DISTANCE_ROUNDING = 2e-3  # [m] rounding of a distance at zero
# Distance below which a limb is not folded further, in lengths of the limb: a knee bent by 113°. In 40 changes of walk,
# run and squat dance joint speeds change by up to 25 rad/s in 8 ms; with half of it by 49, and with 0.8 soles go 10 mm
# below the floor.
_MIN_LENGTH_RATIO = 0.55
# horizontal distances, in limb lengths, where lowering of the root begins to fade and ends
_FADE_START_RATIO, _FADE_END_RATIO = 0.5, 1.0
_HYPEREXTENSION_SCALE = 0.04  # [rad] a in `_reduce_hyperextension`: twice the largest hyperextension that remains


@njit
def _reduce_hyperextension(limb: Array, rotations: Array) -> None:
    """Reduce hyperextension of a limb's middle joint to a small angle; `solve_limb` would take it for flexion.

    An angle α < 0 becomes α / (1 + (α/a)²), with a C² onset at α = 0.
    """
    q = rotations[int(limb[MIDDLE])]
    a, b, axis = vector_at(limb, THIGH), vector_at(limb, SHANK), vector_at(limb, AXIS)
    m = turned_back((q[0], q[1], q[2], q[3]), a)
    angle = np.arctan2(dot(m, cross(b, axis)), dot(m, b) - dot(m, axis) * dot(b, axis))
    if angle < 0.0:
        # Beyond −π/2 the joint is regarded as flexed, by −α.
        wanted = angle / (1.0 + (angle / _HYPEREXTENSION_SCALE) ** 2) if angle > -0.5 * np.pi else -angle
        half = 0.5 * (wanted - angle)
        sine = np.sin(half)
        q[0], q[1], q[2], q[3] = product(
            (q[0], q[1], q[2], q[3]), (np.cos(half), sine * axis[0], sine * axis[1], sine * axis[2])
        )


@njit
def _limb_vector(limb: Array, pose: Pose, end: Array, line: Array) -> float:
    """Write the vector from a limb's first joint to its last for the end pose `end` (7,); returns the full length."""
    hip, longest = lever(limb, OFFSETS, pose), 0.0
    sole = lever(limb, CENTRE, end)
    for i in range(3):
        line[i] = end[i] - sole[i] - pose[i] - hip[i]
    for segment in (THIGH, SHANK):
        x, y, z = vector_at(limb, segment)
        longest += np.sqrt(x**2 + y**2 + z**2)
    return longest


@njit
def required_root_lowering(limb: Array, step: Array, pose: Pose, end: Array) -> float:
    """Lowering of the root [m] with which a limb reaches its end `end` (7,) unstretched, if that is near the floor."""
    line = work_array(3)
    longest = _EASY_EXTENSION_RATIO * _limb_vector(limb, pose, end, line)
    horizontal = np.sqrt(line[0] ** 2 + line[1] ** 2) / longest
    short = max(0.0, -line[2] - longest * np.sqrt(1.0 - min(horizontal, _FADE_START_RATIO) ** 2))
    # The root is not lowered for a foot that is far behind.
    short *= 1.0 - min(max((horizontal - _FADE_START_RATIO) / (_FADE_END_RATIO - _FADE_START_RATIO), 0.0), 1.0) ** 2
    return short * smooth_step(1.0 - (sole_height(limb, end) - step[FLOOR]) / _MAX_LOWERING_HEIGHT)


@njit
def _roll(limb: Array, end: Array, along: Array, angle: float) -> None:
    """Roll a sole by an angle over its edge in a horizontal direction (2,); the edge keeps its place and height."""
    low = sole_height(limb, end)
    point, total = work_array(2), 0.0
    point[:] = 0.0
    for k in range(LIMB_SIZE, limb.shape[0], 3):
        x, y, _ = lever(limb, k, end)
        weight = np.exp((x * along[0] + y * along[1]) / _EDGE_ROUNDING)
        total += weight
        point[0], point[1] = point[0] + weight * x, point[1] + weight * y
    edge = (point[0] * along[0] + point[1] * along[1]) / total
    w, x, y, z = exponential(-angle * along[1], angle * along[0], 0.0)
    end[3], end[4], end[5], end[6] = multiply(w, x, y, z, end[3], end[4], end[5], end[6])
    for i in range(2):
        end[i] += (1.0 - np.cos(angle)) * edge * along[i]
    end[2] += low - sole_height(limb, end)


@njit
def _hold_end(limb: Array, pose: Pose, end: Array, share: float) -> None:
    """Move an end that a limb barely reaches nearer, scaled by `share` from 0 to 1, so that no knee snaps straight.

    The foot first rolls over its edge, so that it stays in contact; the rest is a displacement.
    """
    line, along = work_array(3), work_array(2)
    longest = _limb_vector(limb, pose, end, line)
    distance = np.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
    room = max(_ONSET_RATIO * share * longest, 1e-9)
    over = (distance - (1.0 - _MIN_SHORTENING_RATIO * share) * longest) / room + 1.0
    if over > 0.0:
        # x / (1 + x³)^(1/3) = x − x⁴/3 + … departs from the identity with a C³ onset.
        back = room * over * (1.0 - 1.0 / np.cbrt(1.0 + over**3))
        way = np.sqrt(line[0] ** 2 + line[1] ** 2) + 1e-9
        for i in range(2):
            along[i] = -line[i] / way
        _roll(limb, end, along, smooth_step(way / _ROLL_OFFSET) * _MAX_ROLL * np.tanh(back / (_MAX_ROLL * _ROLL_LEVER)))
        wanted = distance - back
        _limb_vector(limb, pose, end, line)
        distance = np.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
        # Rounded at zero, since after the roll the end may already be nearer than wanted.
        back = distance - wanted
        back = 0.5 * (back + np.sqrt(back**2 + _DISTANCE_ROUNDING**2) - _DISTANCE_ROUNDING) / distance
        for i in range(3):
            end[i] -= back * line[i]
    # The limb does not fold up either: an end too near to the first joint is moved below it.
    least = _MIN_LENGTH_RATIO * share * longest
    if 0.0 < distance < least:
        level = line[0] ** 2 + line[1] ** 2
        near = distance / least
        below = np.sqrt(max(((0.5 + near**3 * (1.0 - 0.5 * near)) * least) ** 2 - level, 0.0))
        end[2] += min(-below - line[2], 0.0)


@njit
def solve_stepping_limb(limb: Array, pose: Pose, end: Array, share: float) -> None:
    """Correct the joints of a stepping limb so that its end has the pose `end`, adjusted by `share` (`_hold_end`)."""
    rotations, last = pose[3:].reshape(-1, 4), int(limb[LAST])
    _reduce_hyperextension(limb, rotations)
    _hold_end(limb, pose, end, share)
    # Twice, since from a straight limb one iteration leaves an error of up to two centimetres.
    for _ in range(2):
        rotations[last] = end[3:]
        solve_limb(limb, rotations, work_array((0, 3, 0)), pose[:3].reshape(1, 3), end[:3].reshape(1, 3), 0)
