r"""LEADING: the stylus leads a walking figure and feels the limits of its following (Donald & Henle 2000, section 8).

The figure's walker is a separate state (`controllers.walking.walking`), which the law reads.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.fields.algebra.feed import Feed
from controllers.fields.algebra.instructions import TRACE_SIZE, write_trace_point
from controllers.fields.algebra.law import Law, Program
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY
from controllers.walking.walking import FOLLOWED, Walking, followed_at
from geometry.arrays import Array
from geometry.vectors import Vector, vector_at


class LeadingGains(NamedTuple):
    """Parameters of `leading_wrench`.

    k_l [N/m], b [N s/m], k_z [N/m], S, and the offsets that the figure follows forwards and backwards [m].
    """

    k_l: float
    b: float
    k_z: float
    scale: float
    lead: float
    lead_back: float


class PathPoint(NamedTuple):
    """The point of the walked path nearest to the stylus.

    Attributes
    ----------
    x, y : float
        Its place on the floor [m].
    c, s : float
        Tangent t = (c, s) of the path there; n = (−s, c).
    along : float
        Arc length of that point minus s + D, its desired value [m].
    room : float
        Offset to each side that the path can reach there [m].
    """

    x: float
    y: float
    c: float
    s: float
    along: float
    room: float


@njit
def leading_force(p: Vector, v: Vector, path: PathPoint, gains: LeadingGains) -> Vector:
    """F of `Leading` in H [N] for a stylus at p [m] with velocity v [m/s]; also on CasADi symbols."""
    x, y, c, s, along, room = path
    k_l, b, k_z, scale, lead, lead_back = gains
    d_x, d_y = scale * p[0] - x, scale * p[1] - y
    d_t, d_n = along + c * d_x + s * d_y, c * d_y - s * d_x
    u_t = (d_t - np.minimum(np.maximum(d_t, -lead_back), lead)) / scale
    u_n = (d_n - np.minimum(np.maximum(d_n, -room), room)) / scale
    return -k_l * (u_t * c - u_n * s) - b * v[0], -k_l * (u_t * s + u_n * c) - b * v[1], -k_z * p[2] - b * v[2]


@njit
def leading_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `Leading`: parameters `LeadingGains`, memory a `WalkerState`."""
    p, v = vector_at(hand, HAND_POSITION), vector_at(hand, HAND_VELOCITY)
    wrench[:] = 0.0
    if not np.isfinite(p[0] + p[1] + p[2] + hand[HAND_TIME]):
        # A value that is not finite must reach the limiter.
        wrench[:3] = np.nan
        return
    gains = LeadingGains(params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5])
    walker = followed_at(memory, slot)
    c, s = np.cos(walker.heading), np.sin(walker.heading)
    path = PathPoint(walker.x, walker.y, c, s, walker.along, walker.room)
    wrench[0], wrench[1], wrench[2] = leading_force(p, v, path, gains)
    q_x, q_y = (walker.x + walker.beyond * c) / gains.scale, (walker.y + walker.beyond * s) / gains.scale
    distance = np.sqrt((p[0] - q_x) ** 2 + (p[1] - q_y) ** 2 + p[2] ** 2)
    write_trace_point(memory, walker.s, (q_x, q_y, 0.0), distance, walker.goal)


@dataclass(frozen=True, eq=False)
class Leading(Law):
    r"""Force on a stylus that leads a walking figure: the stylus is a moving goal over the floor.

    .. math:: F = -\tfrac{k_l}{S}\,(u_t\,t + u_n\,n) - k_z\,z\,e_z - b\,v

    g is the arc length of the path's point nearest to S p, s that of the figure; t and n are the tangent and normal at
    g. The figure walks D behind (see `Walking`). u_t is the part of g − D − s that exceeds what the figure can follow
    at its own pace; u_n is the part of the stylus's distance from the path that exceeds what bending the path can
    reach. On the path already laid this reach is zero, so the hand is guided back along it.

    Parameters
    ----------
    walking : Walking
        How the figure follows.
    k_l, k_z : float
        Stiffness of the force against leaving the region that the figure can follow, and of the plane z = 0 [N/m].
    b : float
        Damping [N s/m].

    Raises
    ------
    ParameterError
        If a number is out of its interval.
    """

    walking: Walking
    k_l: float = 120.0
    k_z: float = 200.0
    b: float = 3.0

    def __post_init__(self) -> None:
        check_field_types(self)
        for name, unit in (("k_l", "N/m"), ("k_z", "N/m"), ("b", "N s/m")):
            checked(name, getattr(self, name), unit)

    def _compose(self) -> Program:
        gains = LeadingGains(self.k_l, self.b, self.k_z, self.walking.scale, *self.walking.lead)
        numbers = np.concatenate([gains, self.walking.packed()])
        feed = Feed(self.walking, TRACE_SIZE, len(gains))
        return Program.of(self, leading_wrench, numbers, np.zeros(FOLLOWED), feeds=(feed,))
