r"""LEADING: the stylus leads a walking figure, and feels how far it can be followed (Donald & Henle 2000, section 8).

The figure walks on its own path A(s) (`controllers.walking.walked_path`): s is how far along it the figure is, and
everything about the figure is a function of s. So going back is s growing less, and poses come back as they were.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from controllers.checks import checked
from controllers.errors import ParameterError
from controllers.fields.instructions import (
    LEADING,
    TRACE_ATTRACTOR,
    TRACE_DISTANCE,
    TRACE_PHASE,
    TRACE_POINT,
    Program,
    wrench_of,
)
from controllers.state import HAND_POSITION, HAND_TIME, HAND_VELOCITY, Array, HandState, Wrench
from controllers.walking.gait import DECISION, Gait, decide_flight, fresh_decision, share_of_stance
from controllers.walking.walked_path import (
    GRAVITY,
    PATH_BEND,
    PATH_HEADING,
    PATH_X,
    PATH_Y,
    ROW,
    ROWS,
    STEP,
    lay_row,
    lean_row,
    path_back,
    path_front,
    path_value,
    straight_path,
)

# Memory: the walker as the seven numbers that a haptic map takes [s, u, 0, 1, 0, 0, 0], its speed, the place on the
# path that is nearest to the stylus, when the last tick was, the bend with which the path is laid, the sum of which
# its lean is made, what is decided of the next flight, then the path.
ARGUMENT, SPEED, GOAL, LAST_TIME, BEND, SWAY, FLIGHT, PATH = 0, 7, 8, 9, 10, 11, 12, 12 + DECISION
HELD = ARGUMENT + 1  # u
_K_L, _B, _K_Z, _SCALE, _RATE, _PULL, _FORWARD, _BACKWARD, _LEAD, _LEAD_BACK = range(10)
_TURN, _LATERAL, _CURVATURE, _AHEAD, _DECAY, _STRIDE = range(10, 16)
_TAKE_OFF, _LANDING, _HASTE, _STANCES, _PHASES, _SHARES = range(16, 22)

_SEARCHES = 4  # steps of the search for the nearest place, warm-started
_LONGEST_TICK = 0.05  # [s] a walker that was not asked for longer has not moved on
_STEERING = 0.15  # [m] of path over which the bend follows the stylus
_MARGIN = 4  # rows of the path that a figure may be ahead of itself, by the filter before its map
_HEIGHT = 1.0  # of the pendulum by which it leans [m]
_FORESIGHT = 1.5  # times the pendulum's length of way


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
        Place on the path next to the stylus [m], and its tangent t = (c, s); n = (−s, c).
    along : float
        How far along the path that place is from where the figure wants it [m].
    back, lead, room : float
        What the figure can follow backwards, forwards and to each side [m]; u_t and u_n are what lies beyond.
    scale, k_l, b : float
        S, k_l [N/m], b [N s/m].
    """
    d_x, d_y = scale * p_x - x, scale * p_y - y
    d_t, d_n = along + c * d_x + s * d_y, c * d_y - s * d_x
    u_t = (d_t - np.minimum(np.maximum(d_t, -back), lead)) / scale
    u_n = (d_n - np.minimum(np.maximum(d_n, -room), room)) / scale
    return -k_l * (u_t * c - u_n * s) - b * v_x, -k_l * (u_t * s + u_n * c) - b * v_y


@njit
def walker_acceleration(lag: float, speed: float, rate: float) -> float:
    """s̈ = ω² (g − D − s) − 2 ω ṡ [m/s²], of a figure that lags by g − D − s [m] and follows with ω [1/s]."""
    return rate * rate * lag - 2.0 * rate * speed


@njit
def _place(memory: Array, path: int, s: float) -> tuple[float, float, float, float]:
    """Place [m], heading [rad] and curvature [1/m] of the path at s, within what there is of it."""
    heading, curvature = path_value(memory, path, s, PATH_HEADING)
    return path_value(memory, path, s, PATH_X)[0], path_value(memory, path, s, PATH_Y)[0], heading, curvature


@njit
def _nearest(memory: Array, path: int, guess: float, x: float, y: float) -> float:
    """Arc length of the place next to (x, y), near a guess, on the path and the straight line on from its front."""
    front, back = path_front(memory, path), path_back(memory, path)
    goal = guess
    for _ in range(_SEARCHES):
        at = min(goal, front)
        a, b, heading, curvature = _place(memory, path, at)
        c, s = np.cos(heading), np.sin(heading)
        along, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Newton's step, damped where the path bends round the stylus.
        stretch = max(1.0 - curvature * side, 0.3) if goal < front else 1.0
        goal = max(goal + (along - (goal - at)) / stretch, back)
    return goal


@njit
def _lay_path(params: Array, at: int, memory: Array, slot: int, x: float, y: float) -> None:
    """Lay the path as far ahead of the figure as its feet need it, bent towards the stylus's place (x, y)."""
    path, speed = slot + PATH, max(memory[slot + SPEED], 0.1)
    limit = min(params[at + _CURVATURE], params[at + _TURN] / speed, params[at + _LATERAL] / (speed * speed))
    ahead, phases = params[at + _AHEAD], params[at + _PHASES]
    while path_front(memory, path) < memory[slot + ARGUMENT] + ahead:
        a, b, heading, _ = _place(memory, path, path_front(memory, path))
        c, s = np.cos(heading), np.sin(heading)
        forward, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Pure pursuit: the arc that is tangent to the path and meets the stylus.
        bend = 2.0 * side / max(forward * forward + side * side, ahead * ahead) if forward > 0.0 else 0.0
        bend = memory[slot + BEND] + (min(max(bend, -limit), limit) - memory[slot + BEND]) * STEP / _STEERING
        bend = min(max(bend, -limit), limit)
        memory[slot + BEND] = bend
        lap = (memory[path] + 0.5) * STEP / params[at + _STRIDE]
        share = params[at + _SHARES + int(phases * (lap - np.floor(lap))) % int(phases)]
        lay_row(memory, path, share * bend * STEP, abs(bend), share * bend * memory[slot + SPEED] ** 2)
        back = int(ahead / STEP) - _MARGIN
        memory[slot + SWAY] = lean_row(memory, path, back, params[at + _DECAY], memory[slot + SWAY])


@njit
def _bent_speed(params: Array, at: int, memory: Array, path: int, s: float, speed: float) -> float:
    """Largest speed at s [m/s] from which the figure can brake for every bend that lies before it."""
    pull, front = min(params[at + _PULL], params[at + _HASTE]), memory[path]
    square = params[at + _FORWARD] ** 2
    rows = int(0.5 * speed * speed / (pull * STEP)) + 6
    first = np.floor(s / STEP) - 2.0 if speed > 0.0 else np.floor(s / STEP) - rows + 4.0
    for k in range(rows):
        row = min(max(first + k, front - ROWS + 1.0), front)
        bend = max(memory[path + 1 + ROW * (int(row) % ROWS) + PATH_BEND], 1e-9)
        # The turn to a row from the one before is made over three steps.
        distance = max(abs(s / STEP - row + 0.5) - 1.5, 0.0) * STEP
        most = min((params[at + _TURN] / bend) ** 2, params[at + _LATERAL] / bend)
        square = min(square, most + 2.0 * pull * distance)
    return np.sqrt(square)


@njit
def _walk(params: Array, at: int, memory: Array, slot: int, dt: float) -> None:
    """The figure follows with inertia: s̈ = ω² (g − D − s) − 2 ω ṡ, bounded, and slower where the path bends."""
    rate, path = params[at + _RATE], slot + PATH
    on_ground = memory[slot + HELD] > 0.5 or params[at + _STANCES] == 0.0
    pull = params[at + (_PULL if on_ground else _HASTE)]
    s, speed = memory[slot + ARGUMENT], memory[slot + SPEED]
    acceleration = walker_acceleration(memory[slot + GOAL] - params[at + _AHEAD] - s, speed, rate)
    speed += dt * min(max(acceleration, -pull), pull)
    most = _bent_speed(params, at, memory, path, s, speed)
    speed = min(max(speed, -params[at + _BACKWARD], -most), most)
    s += dt * speed
    least = path_back(memory, path) + params[at + _AHEAD]
    if s < least:
        s, speed = least, 0.0
    memory[slot + ARGUMENT], memory[slot + SPEED] = s, speed


@njit
def _decide_flight(params: Array, at: int, memory: Array, slot: int) -> None:
    """How far the figure stays on the ground, by its place in the lap and its pace (see `controllers.walking.gait`)."""
    first, lap = at + _SHARES + int(params[at + _PHASES]), memory[slot + ARGUMENT] / params[at + _STRIDE]
    share = share_of_stance(params, first, int(params[at + _STANCES]), lap)
    decide_flight(memory, slot + FLIGHT, share, memory[slot + SPEED], params[at + _TAKE_OFF], params[at + _LANDING])
    memory[slot + HELD] = memory[slot + FLIGHT]


@njit
def leading_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Instruction LEADING: parameters and memory as in the module."""
    p, v = hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3]
    wrench[:] = 0.0
    if not np.isfinite(p[0] + p[1] + p[2] + hand[HAND_TIME]):
        # What is not finite must reach the limiter, and must not reach the path.
        wrench[:3] = np.nan
        return
    path, scale = slot + PATH, params[at + _SCALE]
    x, y = scale * p[0], scale * p[1]
    goal = _nearest(memory, path, memory[slot + GOAL], x, y)
    memory[slot + GOAL] = goal
    dt = hand[HAND_TIME] - memory[slot + LAST_TIME]
    memory[slot + LAST_TIME] = hand[HAND_TIME]
    # False for NaN, the first tick.
    if dt > 0.0:
        _walk(params, at, memory, slot, min(dt, _LONGEST_TICK))
        _decide_flight(params, at, memory, slot)
        _lay_path(params, at, memory, slot, x, y)
    front = path_front(memory, path)
    nearest, beyond = min(goal, front), max(goal - front, 0.0)
    a, b, heading, _ = _place(memory, path, nearest)
    c, s = np.cos(heading), np.sin(heading)
    # Beyond the path any place can be reached that an arc leads to; on it there is no room to the sides.
    room = 0.5 * params[at + _CURVATURE] * beyond * beyond
    wrench[0], wrench[1] = leading_force(
        p[0], p[1], v[0], v[1], a, b, c, s, nearest - memory[slot + ARGUMENT] - params[at + _AHEAD],
        params[at + _LEAD_BACK], params[at + _LEAD], room, scale, params[at + _K_L], params[at + _B],
    )  # fmt: skip
    wrench[2] = -params[at + _K_Z] * p[2] - params[at + _B] * v[2]
    q_x, q_y = (a + beyond * c) / scale, (b + beyond * s) / scale
    distance = np.sqrt((p[0] - q_x) ** 2 + (p[1] - q_y) ** 2 + p[2] ** 2)
    if distance < memory[TRACE_DISTANCE]:
        memory[TRACE_PHASE], memory[TRACE_DISTANCE] = memory[slot + ARGUMENT], distance
        memory[TRACE_ATTRACTOR] = goal
        memory[TRACE_POINT], memory[TRACE_POINT + 1], memory[TRACE_POINT + 2] = q_x, q_y, 0.0


@dataclass(frozen=True, eq=False)
class Leading:
    r"""Force of a figure that is led, on a stylus that moves over the floor like a carrot on a stick.

    .. math::
        F = -\tfrac{k_l}{S}\,(u_t\,t + u_n\,n) - k_z\,z\,e_z - b\,v, \qquad
        \ddot s = \omega^2 (g - D - s) - 2\,\omega\,\dot s

    The stylus at p is at S p on the floor, and wants to be D ahead of the figure, where the path ends that is laid for
    its next step. A(g) is the place next to it on the path and, beyond the front, on the straight line on; t and n are
    tangent and normal there. u_t is the part of g − D − s that lies beyond what the figure follows at its own pace;
    u_n the part of the stylus's distance from the path that lies beyond what bending it can reach: nothing on the path
    that is laid, so backwards the hand is guided along it.

    Nobody flies slowly: a gait with flights begins on the ground, and at each stance decides by its pace whether it
    flies the next one (`controllers.walking.gait`).

    The figure follows with bounded acceleration and speed. In front the path is laid towards the stylus, bent by at
    most κ_max, Ω/ṡ and a/ṡ² times the share of its support: 1 on two feet, less on one, 0 on none. On the path that
    was laid its speed is at most what the same bounds allow. Backwards s decreases; forwards again it increases.

    Parameters
    ----------
    gait : Gait
        Of the figure.
    start : tuple of two floats
        Where the stylus is D ahead of the figure at s = 0, in H [m].
    heading : float
        There [rad], from the x axis of H.
    scale : float
        S, metres on the floor for one of the stylus.
    k_l, k_z : float
        Stiffness of what discourages, and of the plane z = 0 [N/m].
    b : float
        Damping [N s/m].
    rate : float
        ω [1/s].
    pull : float
        Largest |s̈| [m/s²].
    forward, backward : float
        Largest speeds, times the gait's own.
    turn_two, turn_one : float
        Ω, largest turn rates on two feet and on one [rad/s].
    lateral : float
        a, largest lateral acceleration [m/s²].
    curvature : float
        κ_max [1/m].
    take_off, landing : float
        Paces, times the gait's own, from which on a gait that flies does so, and below which it stays on the ground.
    haste : float
        Largest |s̈| while it flies from step to step [m/s²].

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
        """Share of the largest turn rate that the support allows, at equal steps of the lap.

        A row of the path turns it over three steps, so each share is the least over these.
        """
        counts, gait = self.gait.support, self.gait
        share = np.array([0.0, self.turn_one / self.turn_two, 1.0])[counts]
        around = int(np.ceil(1.5 * STEP / gait.stride * len(counts))) + 1
        return np.min([np.roll(share, k) for k in range(-around, around + 1)], axis=0)

    @cached_property
    def _program(self) -> Program:
        gait, path = self.gait, self.path()
        numbers = [
            self.k_l, self.b, self.k_z, self.scale, self.rate, self.pull, self.forward * gait.speed,
            self.backward * gait.speed, 2.0 * gait.speed / self.rate, 2.0 * self.backward * gait.speed / self.rate,
            self.turn_two, self.lateral, self.curvature, self.ahead, np.exp(-STEP / self._sway), gait.stride,
            self.take_off * gait.speed, self.landing * gait.speed,
            self.haste if gait.flies else np.inf, len(gait.stances), len(self.shares), *self.shares,
            *gait.stances.ravel(),
        ]  # fmt: skip
        walker = np.zeros(PATH)
        walker[ARGUMENT + 3], walker[GOAL], walker[LAST_TIME] = 1.0, self.ahead, np.nan
        walker[HELD] = float(gait.flies)
        walker[FLIGHT:PATH] = fresh_decision(gait.flies)
        return Program.law(LEADING, numbers, np.concatenate([walker, path]).tolist())

    @property
    def ahead(self) -> float:
        """D, how far ahead of the figure its path is laid [m]: a foot finds its place there, and a bend its lean."""
        return max(self.gait.reach, _FORESIGHT * self._sway) + _MARGIN * STEP

    @property
    def _sway(self) -> float:
        """Way over which an inverted pendulum falls by a factor of e at the gait's own speed [m]."""
        return self.gait.speed * float(np.sqrt(_HEIGHT / GRAVITY))

    def path(self) -> Array:
        """Packed path of a figure that has not been led yet."""
        x, y = self.start
        c, s = np.cos(self.heading), np.sin(self.heading)
        return straight_path(self.scale * x - self.ahead * c, self.scale * y - self.ahead * s, self.heading, self.ahead)

    def program(self) -> Program:
        """Compiled form of the field; figure and path lie in its memory."""
        return self._program

    def wrench(self, hand: HandState) -> Wrench:
        """F at one hand state, by the compiled law, with the figure where it begins."""
        return wrench_of(leading_wrench, self._program, hand)
