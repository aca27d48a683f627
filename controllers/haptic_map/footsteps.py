r"""Steps in a transition: feet do not slide to where the new motion has them, one after the other they step there.

With E_n(s) where the end of a limb is in the new motion, and E_o(s) where it was, coming to rest within half of the
blend time, the end goes

.. math:: E(s) = E_o + \beta(x)\,(E_n - E_o) + b(x)\,\lambda\,|E_n - E_o|_{xy}\,e_z

with the smooth step β = 10 x³ − 15 x⁴ + 6 x⁵ and the arc b = 64 x³ (1 − x)³; orientations likewise on SO(3). x runs
from 0 to 1 in the limb's own half of the blend time: in the first half for the foot that is higher, or has the longer
way to go, in the second for the other one, which stands until then. So position, velocity and acceleration of the feet
are continuous, and a foot that moves does so above the ground. The limb's joints follow (`limbs`).
"""

import numpy as np
from numba import njit

from controllers.haptic_map.inertialization import offset_left, stopping_way
from controllers.haptic_map.limbs import place_limb
from controllers.rotations import exponential, logarithm, multiply, relative, rotate
from controllers.state import Array, Pose

_LIFT = 0.2  # λ: height of a step over its length
_LEVEL = 0.01  # [m] feet that differ by less in height are equally high
_SOONEST = 0.05  # [s] in which a foot that falls comes to rest at least
# A row of `steps`: when the step begins, place and orientation where the old motion comes to rest, and the offsets
# from there with their rates, (3, 3) each; and the time to get there.
_BEGIN, _PLACE, _TURN, _AWAY, _TURNED, _STOP, STEP = 0, 1, 4, 8, 17, 26, 27


@njit
def limb_end(limb: Array, pose: Pose, end: Array) -> None:
    """Position of the centre of a limb's end in the world [m] and its orientation (wxyz), written to `end` (7,)."""
    end[:] = pose[:7]
    for i in range(3):
        at = 3 + 4 * int(limb[i])
        x, y, z = rotate(end[3], end[4], end[5], end[6], limb[3 + 3 * i], limb[4 + 3 * i], limb[5 + 3 * i])
        end[0], end[1], end[2] = end[0] + x, end[1] + y, end[2] + z
        end[3], end[4], end[5], end[6] = multiply(
            end[3], end[4], end[5], end[6], pose[at], pose[at + 1], pose[at + 2], pose[at + 3]
        )
    x, y, z = rotate(end[3], end[4], end[5], end[6], limb[15], limb[16], limb[17])
    end[0], end[1], end[2] = end[0] + x, end[1] + y, end[2] + z


@njit
def put_limb(limb: Array, pose: Pose, end: Array) -> None:
    """Correct the joints of a limb such that its end is where `end` (7,) says."""
    rotations = pose[3:].reshape(-1, 4)
    rotations[int(limb[2])] = end[3:]
    place_limb(limb, rotations, np.empty((0, 3, 0)), pose[:3].reshape(1, 3), end[:3].reshape(1, 3), 0)


@njit
def _come_to_rest(values: Array, period: float, seconds: float, rest: Array, change: Array) -> None:
    """Where a motion with samples (3, 3) now, a period before and after comes to rest; offset from there and rates."""
    for i in range(3):
        change[1, i] = 0.5 * (values[2, i] - values[1, i]) / period
        change[2, i] = (values[2, i] - 2.0 * values[0, i] + values[1, i]) / period**2
        change[0, i] = -stopping_way(change[1, i], change[2, i], seconds)
        rest[i] = values[0, i] - change[0, i]


@njit
def plan_steps(limbs: Array, steps: Array, shown: Array, asked: Pose, period: float, seconds: float) -> None:
    """Note how the ends of limbs move at a change, and which of two steps first.

    Parameters
    ----------
    limbs : Array, shape (n, 36)
        `Limb.packed`.
    steps : Array, shape (n, STEP)
        Written.
    shown : Array, shape (3, nq)
        Poses of the old motion now, a period before and after.
    asked : Pose
        Of the new motion now.
    period, seconds : float
        Between the samples, and the blend time T [s].
    """
    half = 0.5 * seconds
    ends, turns, way = np.empty((3, 7)), np.empty((3, 3)), np.empty(3)
    urgency, ground = np.empty(limbs.shape[0]), np.inf
    for n in range(limbs.shape[0]):
        limb_end(limbs[n], shown[0], ends[0])
        ground = min(ground, ends[0, 2])
    for n in range(limbs.shape[0]):
        step = steps[n]
        for j in range(3):
            limb_end(limbs[n], shown[j], ends[j])
        # Not deeper than the foot that stands.
        fall, height = 0.5 * (ends[1, 2] - ends[2, 2]) / period, ends[0, 2] - ground
        stop = half if fall <= 0.0 else min(half, max(2.0 * height / fall, _SOONEST))
        step[_STOP] = stop
        _come_to_rest(ends[:, :3], period, stop, step[_PLACE:_TURN], step[_AWAY:_TURNED].reshape(3, 3))
        w, x, y, z = ends[0, 3], ends[0, 4], ends[0, 5], ends[0, 6]
        for j in range(3):
            turns[j] = logarithm(*relative(w, x, y, z, ends[j, 3], ends[j, 4], ends[j, 5], ends[j, 6]))
        change = step[_TURNED:_STOP].reshape(3, 3)
        _come_to_rest(turns, period, stop, way, change)
        step[_TURN:_AWAY] = multiply(w, x, y, z, *exponential(way[0], way[1], way[2]))
        # Seen from where it rests, exactly: rotations do not add.
        w, x, y, z = step[_TURN], step[_TURN + 1], step[_TURN + 2], step[_TURN + 3]
        for j in range(3):
            turns[j] = logarithm(*relative(w, x, y, z, ends[j, 3], ends[j, 4], ends[j, 5], ends[j, 6]))
        _come_to_rest(turns, period, stop, way, change)
        change[0] = turns[0]
        limb_end(limbs[n], asked, ends[1])
        urgency[n] = np.floor(height / _LEVEL) + np.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1])
    for n in range(limbs.shape[0]):
        steps[n, _BEGIN] = 0.0 if n == np.argmax(urgency) else half


@njit
def step_end(step: Array, s: float, seconds: float, end: Array) -> None:
    """Move an end of the new motion, `end` (7,), to where it is s seconds after the change, in its step."""
    stop = step[_STOP]
    x = min(max((s - step[_BEGIN]) / (0.5 * seconds), 0.0), 1.0)
    if x >= 1.0:
        return
    share = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    left = np.empty(3)
    offset_left(step[_AWAY:_TURNED].reshape(3, 3), stop, min(s, stop), left)
    way = 0.0
    for i in range(3):
        old = step[_PLACE + i] + left[i]
        ahead = end[i] - old
        way += ahead * ahead if i < 2 else 0.0
        end[i] = old + share * ahead
    # Rounded at zero, where a root has no derivative.
    end[2] += 64.0 * (x * (1.0 - x)) ** 3 * _LIFT * (np.sqrt(way + 1e-4) - 1e-2)
    offset_left(step[_TURNED:_STOP].reshape(3, 3), stop, min(s, stop), left)
    w, a, b, c = multiply(
        step[_TURN], step[_TURN + 1], step[_TURN + 2], step[_TURN + 3], *exponential(left[0], left[1], left[2])
    )
    turn = logarithm(*relative(w, a, b, c, end[3], end[4], end[5], end[6]))
    end[3], end[4], end[5], end[6] = multiply(
        w, a, b, c, *exponential(share * turn[0], share * turn[1], share * turn[2])
    )
