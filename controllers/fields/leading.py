r"""LEADING: the stylus leads a walking figure and feels the limits of its following (Donald & Henle 2000, section 8).

The figure is represented by a `controllers.walking.walker.Walker` in the law's memory, which this law advances.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.fields.instructions import TRACE_SIZE, leave_place
from controllers.fields.law import Law, Program
from controllers.gravity import GRAVITY
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY, Array
from controllers.walking.gait import Gait
from controllers.walking.walked_path import STEP, path_front, straight_path
from controllers.walking.walker import (
    MARGIN,
    Following,
    Walker,
    following_at,
    fresh_walker,
    lead,
    packed_following,
    path_place,
    walker_at,
)

_HEIGHT = 1.0  # [m] of the linear inverted pendulum that models the figure's sway
_FORESIGHT = 1.5  # preview of the path, in distances over which the pendulum falls by a factor of e


@njit
def leading_force(
    p_x: float, p_y: float, v_x: float, v_y: float, x: float, y: float, c: float, s: float, along: float,
    back: float, lead: float, room: float, scale: float, k_l: float, b: float,
) -> tuple[float, float]:  # fmt: skip
    r"""F = −k_l (u_t t + u_n n)/S − b v in the plane, in H.

    Parameters
    ----------
    p_x, p_y, v_x, v_y : float
        Stylus [m], [m/s].
    x, y, c, s : float
        Point of the path nearest to the stylus, on the floor [m], and the tangent t = (c, s) there; n = (−s, c).
    along : float
        Arc length of that point minus s + D, where the figure wants it [m].
    back, lead, room : float
        Offsets that the figure can follow backwards, forwards and to each side [m]; u_t and u_n are the excess.
    scale, k_l, b : float
        S, k_l [N/m], b [N s/m].
    """
    d_x, d_y = scale * p_x - x, scale * p_y - y
    d_t, d_n = along + c * d_x + s * d_y, c * d_y - s * d_x
    u_t = (d_t - np.minimum(np.maximum(d_t, -back), lead)) / scale
    u_n = (d_n - np.minimum(np.maximum(d_n, -room), room)) / scale
    return -k_l * (u_t * c - u_n * s) - b * v_x, -k_l * (u_t * s + u_n * c) - b * v_y


class LeadingGains(NamedTuple):
    """Parameters of `leading_wrench`, before those of the walker.

    k_l [N/m], b [N s/m], k_z [N/m], S, and the offsets that the figure follows forwards and backwards [m].
    """

    k_l: float
    b: float
    k_z: float
    scale: float
    lead: float
    lead_back: float


@njit
def leading_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `Leading`: parameters `LeadingGains` and `Following`, memory a `Walker`."""
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    wrench[:] = 0.0
    if not np.isfinite(p[0] + p[1] + p[2] + hand[HAND_TIME]):
        # What is not finite must reach the limiter, and must not reach the path.
        wrench[:3] = np.nan
        return
    gains = LeadingGains(
        params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5]
    )  # fmt: skip
    follow, walker, scale = following_at(params, at + 6), walker_at(memory, slot), gains.scale
    lead(follow, walker, hand[HAND_TIME], scale * p[0], scale * p[1])
    goal, front = walker.goal[0], path_front(walker.path)
    nearest, beyond = min(goal, front), max(goal - front, 0.0)
    a, b, heading, _ = path_place(walker.path, nearest)
    c, s = np.cos(heading), np.sin(heading)
    # At L beyond the path's front an arc of curvature κ_max reaches κ_max L²/2 to the side; on the path room is 0.
    room = 0.5 * follow.curvature * beyond * beyond
    wrench[0], wrench[1] = leading_force(
        p[0], p[1], v[0], v[1], a, b, c, s, nearest - walker.argument[0] - follow.ahead,
        gains.lead_back, gains.lead, room, scale, gains.k_l, gains.b,
    )  # fmt: skip
    wrench[2] = -gains.k_z * p[2] - gains.b * v[2]
    q_x, q_y = (a + beyond * c) / scale, (b + beyond * s) / scale
    distance = np.sqrt((p[0] - q_x) ** 2 + (p[1] - q_y) ** 2 + p[2] ** 2)
    leave_place(memory, walker.argument[0], (q_x, q_y, 0.0), distance, goal)


@dataclass(frozen=True, eq=False)
class Leading(Law):
    r"""Force on a stylus that leads a walking figure: the stylus is a moving goal over the floor.

    .. math::
        F = -\tfrac{k_l}{S}\,(u_t\,t + u_n\,n) - k_z\,z\,e_z - b\,v, \qquad
        \ddot s = \omega^2 (g - D - s) - 2\,\omega\,\dot s

    The stylus at p stands for the point S p on the floor. In equilibrium it is D ahead of the figure, where the path
    laid for the next step ends. g is the arc length of the path's point nearest to S p (beyond the path's front, of the
    straight line that continues it), s that of the figure; t and n are the tangent and normal at g. u_t is the part of
    g − D − s beyond what the figure follows at its own pace; u_n the part of the stylus's distance from the path beyond
    what bending the path can reach. On the path already laid this reach is zero, so the hand is guided back along it.

    A gait with flight phases needs speed: it starts grounded, and at each stance the figure's pace decides whether the
    next flight phase is taken (`controllers.walking.gait`).

    The figure follows with bounded acceleration and speed. Ahead, the path is laid towards the stylus with a curvature
    of at most κ_max, Ω/ṡ and a/ṡ², scaled by the support: 1 in double support, less in single support, 0 in flight. On
    the path already laid the same bounds limit its speed. Led backwards s decreases; forwards again it increases.

    Parameters
    ----------
    gait : Gait
        Gait of the figure.
    start : tuple of two floats
        Position of the stylus in H [m] at which it is D ahead of the figure at s = 0.
    heading : float
        Heading of the path there [rad], from the x axis of H.
    scale : float
        S, metres on the floor for one metre of the stylus.
    k_l, k_z : float
        Stiffness of the force that resists leaving what the figure can follow, and of the plane z = 0 [N/m].
    b : float
        Damping [N s/m].
    rate : float
        ω [1/s].
    pull : float
        Largest |s̈| [m/s²].
    forward, backward : float
        Largest speeds, in multiples of the gait's own speed.
    turn_two, turn_one : float
        Ω, largest turn rates in double and in single support [rad/s].
    lateral : float
        a, largest lateral acceleration [m/s²].
    curvature : float
        κ_max [1/m].
    take_off, landing : float
        Speeds, in multiples of the gait's own, above which a running gait takes its flight phases, and below which it
        stays grounded.
    haste : float
        Largest |s̈| while the gait has flight phases [m/s²].

    Raises
    ------
    ParameterError
        If a number is not finite, or out of its interval.
    """

    gait: Gait
    start: tuple[float, float] = (0.0, 0.0)
    heading: float = 0.0
    scale: float = 40.0
    k_l: float = 120.0
    k_z: float = 200.0
    b: float = 3.0
    rate: float = 2.5
    pull: float = 1.5
    forward: float = 1.3
    backward: float = 0.65
    turn_two: float = 1.2
    turn_one: float = 0.9
    lateral: float = 2.5
    curvature: float = 1.0
    take_off: float = 0.9
    landing: float = 0.85
    haste: float = 0.5

    def __post_init__(self) -> None:
        for name, unit in (("k_l", "N/m"), ("k_z", "N/m"), ("b", "N s/m"), ("turn_one", "rad/s")):
            checked(name, getattr(self, name), unit)
        for name, unit in (
            ("scale", ""), ("rate", "1/s"), ("pull", "m/s²"), ("forward", ""), ("backward", ""),
            ("turn_two", "rad/s"), ("lateral", "m/s²"), ("curvature", "1/m"), ("take_off", ""), ("landing", ""),
            ("haste", "m/s²"),
        ):  # fmt: skip
            checked(name, getattr(self, name), unit, least=1e-3)
        if not np.isfinite([*self.start, self.heading]).all():
            raise ParameterError(f"start and heading must be finite, got {self.start} m and {self.heading} rad")
        if self.landing > self.take_off:
            raise ParameterError(
                f"a gait takes off at no lower pace than it lands at, got {self.take_off} and {self.landing} of its own"
            )
        if self.turn_one > self.turn_two:
            raise ParameterError(
                f"a figure turns no faster on one foot than on two, got {self.turn_one} and {self.turn_two} rad/s"
            )

    @cached_property
    def shares(self) -> Array:
        """Fraction of the largest turn rate that the support (feet on the floor) allows, at equal steps of the lap.

        A row of the path turns it over three steps of its grid, so each share is the least within 1.5 steps around it.
        """
        counts, gait = self.gait.support, self.gait
        share = np.array([0.0, self.turn_one / self.turn_two, 1.0])[counts]
        around = int(np.ceil(1.5 * STEP / gait.stride * len(counts))) + 1
        return np.min([np.roll(share, k) for k in range(-around, around + 1)], axis=0)

    @cached_property
    def _program(self) -> Program:
        gait = self.gait
        follow = Following(
            rate=self.rate, pull=self.pull, forward=self.forward * gait.speed, backward=self.backward * gait.speed,
            turn=self.turn_two, lateral=self.lateral, curvature=self.curvature,
            take_off=self.take_off * gait.speed, landing=self.landing * gait.speed,
            haste=self.haste if gait.flies else np.inf, ahead=self.ahead, decay=float(np.exp(-STEP / self._sway)),
            stride=gait.stride, shares=self.shares, stances=gait.stances,
        )  # fmt: skip
        gains = LeadingGains(
            self.k_l, self.b, self.k_z, self.scale, 2.0 * gait.speed / self.rate,
            2.0 * self.backward * gait.speed / self.rate,
        )  # fmt: skip
        numbers = np.concatenate([gains, packed_following(follow)])
        return Program.of(self, leading_wrench, numbers, fresh_walker(gait, self.ahead, self.path()))

    @property
    def ahead(self) -> float:
        """D, length of path laid ahead of the figure [m]: enough to place a foot, and to lean into a bend in time."""
        return max(self.gait.reach, _FORESIGHT * self._sway) + MARGIN * STEP

    @property
    def _sway(self) -> float:
        """Distance covered at the gait's own speed while an inverted pendulum falls by a factor of e [m]."""
        return self.gait.speed * float(np.sqrt(_HEIGHT / GRAVITY))

    def path(self) -> Array:
        """Packed path of a figure that has not been led yet."""
        x, y = self.start
        c, s = np.cos(self.heading), np.sin(self.heading)
        return straight_path(self.scale * x - self.ahead * c, self.scale * y - self.ahead * s, self.heading, self.ahead)

    def program(self) -> Program:
        """Compiled form of the field; the walker lies in its memory."""
        return self._program

    def walker(self, memory: Array, slot: int = TRACE_SIZE) -> Walker:
        """The walker of a run as views of the memory, for display and measurement.

        Parameters
        ----------
        memory : Array
            Memory of the field's program, or of a program that contains this field.
        slot : int
            Offset of this field in it (`Program.places`).
        """
        return walker_at.py_func(memory, slot)
