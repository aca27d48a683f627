r"""Inertialisation: from one motion into another without a jump (Bollo, GDC 2018, "Inertialization").

Only the new motion goes on. At the change the old one is ahead of it by an offset o with rates ȯ and ö, in the
tangent space of the new pose; the offset is added to the new motion and decays to rest within the blend time T:

.. math:: o(s) = (1 - x)^3 \bigl(o\,(1 + 3x + 6x^2) + T \dot o\,(x + 3x^2) + \tfrac12 T^2 \ddot o\,x^2\bigr),
          \qquad x = s/T

the quintic with o, ȯ, ö at s = 0 and zero, at rest and without acceleration, at s = T. So pose, velocity and
acceleration are continuous there and here. We keep every component's own rate, also where it points away from the new
motion, which Bollo clips: a joint may then swing on by up to 0.16 T ȯ, as an inert one does. A leg in full kick would
be thrown out of its joints by that; so where it exceeds a greatest swing, what ȯ and ö add decays within a T of their
own, in which it is just that.

Where the figure stands does not come back: see `stopping_way`.
"""

import math

from numba import njit

from controllers.rotations import exponential, multiply
from controllers.state import Array, Pose, Tangent

_SWING = 0.16  # of T ȯ: how far the rate alone carries an offset


@njit
def offset_left(change: Array, seconds: float, s: float, offset: Tangent, swing: float = math.inf) -> None:
    """What is left of an offset s seconds after the change.

    Parameters
    ----------
    change : Array, shape (3, n)
        o, ȯ, ö at the change.
    seconds : float
        T > 0 [s].
    s : float
        Time since the change [s], below T; before the change the polynomial goes on.
    offset : Tangent, shape (n,)
        Written.
    swing : float
        How far a component may swing on by its rate, by default without limit.
    """
    x = s / seconds
    value = (1.0 - x) ** 3 * (1.0 + x * (3.0 + 6.0 * x))
    for i in range(offset.shape[0]):
        own = seconds
        if _SWING * seconds * abs(change[1, i]) > swing:
            own = swing / (_SWING * abs(change[1, i]))
        offset[i] = value * change[0, i]
        y = s / own
        if y < 1.0:
            moving = own * (1.0 - y) ** 3 * y
            offset[i] += moving * (1.0 + 3.0 * y) * change[1, i] + 0.5 * moving * own * y * change[2, i]


@njit
def stopping_way(speed: float, acceleration: float, seconds: float) -> float:
    """Way from o = 0 with rates ȯ, ö to rest within T, such that the velocity is a cubic: T ȯ/2 + T² ö/12.

    A new motion that begins this much ahead is reached without coming back: then the quintic of `offset_left` is the
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
