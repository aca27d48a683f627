"""Following of the stylus by a led figure: the parameters of its walker, and the walker's kernel."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.state import HAND_POSITION, HAND_TIME
from controllers.walking.gait import Gait
from controllers.walking.walked_path import STEP, path_front, straight_path
from controllers.walking.walker import (
    RESERVE_ROWS,
    Following,
    following_at,
    fresh_walker,
    lead,
    packed_following,
    path_place,
    walker_at,
)
from geometry.arrays import Array
from geometry.physics import GRAVITY

# [m] height of the linear inverted pendulum that models the lean; the centre of mass stands at 1.02
_PENDULUM_HEIGHT = 1.0
_PREVIEW_RATIO = 1.5  # preview of the path, in distances over which the pendulum falls by a factor of e


class WalkerState(NamedTuple):
    """State of a walker that a force law reads.

    Attributes
    ----------
    s, goal : float
        Arc lengths of the figure, and of the path's point nearest to the stylus (beyond the front, of the straight line
        that continues it) [m].
    x, y, heading : float
        That point, or the path's front if it lies beyond [m], and the heading there [rad].
    along : float
        Arc length of (x, y) minus s + D, where it is in equilibrium [m].
    beyond : float
        Distance of g beyond the path's front [m], 0 on the path.
    room : float
        Offset to each side that the path can reach there [m]: κ_max L²/2 at L beyond its front, 0 on it.
    """

    s: float
    goal: float
    x: float
    y: float
    heading: float
    along: float
    beyond: float
    room: float


FOLLOWED = len(WalkerState._fields)


@njit
def followed_at(numbers: Array, at: int) -> WalkerState:
    """The `WalkerState` that `follow_hand` wrote at ``numbers[at:]``."""
    return WalkerState(
        numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at + 4], numbers[at + 5],
        numbers[at + 6], numbers[at + 7],
    )  # fmt: skip


@njit
def follow_hand(params: Array, at: int, slot: int, walkers: Array, place: int, hand: Array, memory: Array) -> None:
    """Kernel of a walker: advance it to the hand's time, and write the state that a law reads.

    If the state of the hand is not finite, nothing is changed.

    Parameters
    ----------
    params, at
        S and a `Following` lie at ``params[at:]``.
    slot, memory
        A `WalkerState` is written to ``memory[slot:]``.
    walkers, place
        The numbers of the `Walker` lie at ``walkers[place:]``.
    hand : Array, shape (15,)
        State of the hand.
    """
    x, y, z = hand[HAND_POSITION], hand[HAND_POSITION + 1], hand[HAND_POSITION + 2]
    if not np.isfinite(x + y + z + hand[HAND_TIME]):
        return
    scale, follow, walker = params[at], following_at(params, at + 1), walker_at(walkers, place)
    lead(follow, walker, hand[HAND_TIME], scale * x, scale * y)
    goal, front = walker.goal[0], path_front(walker.path)
    nearest, beyond = min(goal, front), max(goal - front, 0.0)
    a, b, heading, _ = path_place(walker.path, nearest)
    followed = WalkerState(
        s=walker.argument[0], goal=goal, x=a, y=b, heading=heading, along=nearest - walker.argument[0] - follow.ahead,
        beyond=beyond, room=0.5 * follow.curvature * beyond * beyond,
    )  # fmt: skip
    for k in range(FOLLOWED):
        memory[slot + k] = followed[k]


@dataclass(frozen=True, eq=False)
class Walking:
    r"""How a figure follows a stylus that is a moving goal over the floor.

    .. math:: \ddot s = \omega^2 (g - D - s) - 2\,\omega\,\dot s

    The stylus at p stands for the point S p on the floor. In equilibrium it is D ahead of the figure, where the path
    laid for the next step ends. g is the arc length of the path's point nearest to S p (beyond the path's front, of the
    straight line that continues it), s that of the figure.

    A gait with flight phases needs speed: it starts grounded, and at each stance the figure's pace decides whether the
    next flight phase is taken (`controllers.walking.gait`).

    The figure follows with bounded acceleration and speed. Ahead, the path is laid towards the stylus with a curvature
    of at most κ_max, Ω/ṡ and a/ṡ², scaled by the support: 1 in double support, less in single support, 0 in flight. On
    the path already laid the same bounds limit its speed. Led backwards s decreases; forwards again it increases.

    The state is a `controllers.walking.walker.Walker`, which the servo advances before the field (`follow_hand`). The
    law of force (`controllers.fields.leading`) reads its `WalkerState`, the haptic map (`controllers.haptic_map.led`)
    its argument and its path.

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
    flight_pull : float
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
    flight_pull: float = 0.5

    def __post_init__(self) -> None:
        checked("turn_one", self.turn_one, "rad/s")
        for name, unit in (
            ("scale", ""), ("rate", "1/s"), ("pull", "m/s²"), ("forward", ""), ("backward", ""),
            ("turn_two", "rad/s"), ("lateral", "m/s²"), ("curvature", "1/m"), ("take_off", ""), ("landing", ""),
            ("flight_pull", "m/s²"),
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

    @property
    def ahead(self) -> float:
        """D, length of path laid ahead of the figure [m]: enough to place a foot, and to lean into a bend in time."""
        return max(self.gait.reach, _PREVIEW_RATIO * self._lean_length) + RESERVE_ROWS * STEP

    @property
    def lead(self) -> tuple[float, float]:
        """Offsets of the stylus from D ahead, forwards and backwards [m], that the figure follows at its own pace."""
        return 2.0 * self.gait.speed / self.rate, 2.0 * self.backward * self.gait.speed / self.rate

    @property
    def _lean_length(self) -> float:
        """Distance covered at the gait's own speed while an inverted pendulum falls by a factor of e [m]."""
        return self.gait.speed * float(np.sqrt(_PENDULUM_HEIGHT / GRAVITY))

    def packed(self) -> Array:
        """Parameters of `follow_hand`: S, then a `Following`."""
        gait = self.gait
        follow = Following(
            rate=self.rate, pull=self.pull, forward=self.forward * gait.speed, backward=self.backward * gait.speed,
            turn=self.turn_two, lateral=self.lateral, curvature=self.curvature,
            take_off=self.take_off * gait.speed, landing=self.landing * gait.speed,
            flight_pull=self.flight_pull if gait.flies else np.inf, ahead=self.ahead,
            decay=float(np.exp(-STEP / self._lean_length)), stride=gait.stride, shares=self.shares,
            stances=gait.stances,
        )  # fmt: skip
        return np.concatenate([[self.scale], packed_following(follow)])

    def path(self) -> Array:
        """Packed path of a figure that has not been led yet."""
        x, y = self.start
        c, s = np.cos(self.heading), np.sin(self.heading)
        return straight_path(self.scale * x - self.ahead * c, self.scale * y - self.ahead * s, self.heading, self.ahead)

    def fresh(self) -> Array:
        """Numbers of the walker of a figure that has not been led yet."""
        return fresh_walker(self.gait, self.ahead, self.path())
