r"""Inertialisation: transition from one motion to another without a jump (Bollo, GDC 2018, "Inertialization").

Only the new motion is evaluated after the change. At the change the old pose differs from the new one by an offset o
with rates ȯ and ö, in the tangent space of the new pose; it is added to the new motion and decays to zero within the
blend time T:

.. math:: o(s) = (1 - x)^3 \bigl(o\,(1 + 3x + 6x^2) + T \dot o\,(x + 3x^2) + \tfrac12 T^2 \ddot o\,x^2\bigr),
          \qquad x = s/T

the quintic with o, ȯ, ö at s = 0 and value, velocity and acceleration zero at s = T. So pose, velocity and acceleration
are continuous at both ends. Every component keeps its own rate, also where it points away from the new motion (Bollo
clips it there): a joint then overshoots by up to 0.2 T ȯ, as if by its inertia. That could throw a fast leg beyond its
joint limits; so where 0.16 T ȯ would exceed a largest swing, the terms of ȯ and ö decay within a shorter time of their
own, for which it equals that swing: the overshoot is then up to 1.24 times the swing.

For the position of the figure on the floor, which need not return, see `stopping_distance`.
"""

import math

from numba import njit

from controllers.state import Pose, Tangent
from geometry.arrays import Array
from geometry.rotations import exponential, multiply

# Overshoot over T ȯ that is assumed in limiting it; the term of ȯ, x (1 + 3x) (1 − x)³, reaches 16/81 = 0.198.
_OVERSHOOT_RATIO = 0.16


@njit
def decaying_offset(change: Array, seconds: float, s: float, offset: Tangent, swing: float = math.inf) -> None:
    """Remaining offset s seconds after the change.

    Parameters
    ----------
    change : Array, shape (3, n)
        o, ȯ, ö at the change.
    seconds : float
        T > 0 [s].
    s : float
        Time since the change [s], below T; for negative times the polynomial is continued.
    offset : Tangent, shape (n,)
        Written.
    swing : float
        Largest overshoot of a component due to its rate, by default without limit.
    """
    x = s / seconds
    value = (1.0 - x) ** 3 * (1.0 + x * (3.0 + 6.0 * x))
    for i in range(offset.shape[0]):
        decay_time = seconds
        if _OVERSHOOT_RATIO * seconds * abs(change[1, i]) > swing:
            decay_time = swing / (_OVERSHOOT_RATIO * abs(change[1, i]))
        offset[i] = value * change[0, i]
        y = s / decay_time
        if y < 1.0:
            moving = decay_time * (1.0 - y) ** 3 * y
            offset[i] += moving * (1.0 + 3.0 * y) * change[1, i] + 0.5 * moving * decay_time * y * change[2, i]


@njit
def stopping_distance(speed: float, acceleration: float, seconds: float) -> float:
    """Stopping distance T ȯ/2 + T² ö/12 from the rates ȯ, ö to rest within T, with a velocity that is a cubic.

    A new motion that is placed this far ahead is reached without a return: the quintic of `decaying_offset` is then the
    quartic whose velocity is ȯ (1 − x)² (1 + 2x) + T ö x (1 − x)².
    """
    return seconds * speed / 2.0 + seconds**2 * acceleration / 12.0


@njit
def add_offset(pose: Pose, offset: Tangent) -> None:
    """Move a pose along a tangent: the root's position in the world, root and joints by R exp(o) in their own frames.

    Parameters
    ----------
    pose : Pose, shape (7 + 4 joints,)
        Updated.
    offset : Tangent, shape (6 + 3 joints,)
        [m], [rad].
    """
    for i in range(3):
        pose[i] += offset[i]
    for joint in range((pose.shape[0] - 3) // 4):
        at, o = 3 + 4 * joint, 3 + 3 * joint
        w, x, y, z = exponential(offset[o], offset[o + 1], offset[o + 2])
        pose[at], pose[at + 1], pose[at + 2], pose[at + 3] = multiply(
            pose[at], pose[at + 1], pose[at + 2], pose[at + 3], w, x, y, z
        )
