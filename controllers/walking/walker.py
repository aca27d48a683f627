r"""A figure that is led: where it is on its path, how fast it goes, and what is laid before it.

The figure walks on its own path A(s) (`controllers.walking.walked_path`): s is how far along it the figure is, and
everything about the figure is a function of s. So going back is s growing less, and poses come back as they were.
A law of force moves the walker, and a haptic map shows it: both are given a `Walker`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.state import Array
from controllers.walking.gait import DECISION, Gait, decide_flight, fresh_decision, share_of_stance
from controllers.walking.walked_path import (
    PACKED_PATH,
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
)

_ARGUMENT = 7
_DECIDED = _ARGUMENT + 5
_PATH = _DECIDED + DECISION
_SEARCHES = 4  # steps of the search for the nearest place, warm-started
_LONGEST_TICK = 0.05  # [s] a walker that was not asked for longer has not moved on
_STEERING = 0.15  # [m] of path over which the bend follows the stylus
MARGIN = 4  # rows of the path that a figure may be ahead of itself, by the filter before its map


class Walker(NamedTuple):
    """State of a walker: views of one array of numbers.

    Attributes
    ----------
    argument : Array, shape (7,)
        What a haptic map is evaluated at, ``[s, u, 0, 1, 0, 0, 0]``: arc length [m], and how far it stays on the
        ground, 0 to 1.
    speed : Array, shape (1,)
        ṡ [m/s].
    goal : Array, shape (1,)
        g, the place on the path that is nearest to the stylus [m].
    time : Array, shape (1,)
        Of the last tick [s].
    bend : Array, shape (1,)
        With which the path is laid [1/m].
    sway : Array, shape (1,)
        Sum of which its lean is made [m/s²].
    flight : Array, shape (4,)
        What is decided of the next flight (see `controllers.walking.gait`).
    path : Array
        Packed path.
    """

    argument: Array
    speed: Array
    goal: Array
    time: Array
    bend: Array
    sway: Array
    flight: Array
    path: Array


@njit
def walker_at(numbers: Array, at: int) -> Walker:
    """The walker whose numbers begin at ``numbers[at]``."""
    one = at + _ARGUMENT
    return Walker(
        numbers[at:one], numbers[one : one + 1], numbers[one + 1 : one + 2], numbers[one + 2 : one + 3],
        numbers[one + 3 : one + 4], numbers[one + 4 : one + 5], numbers[at + _DECIDED : at + _PATH],
        numbers[at + _PATH : at + _PATH + PACKED_PATH],
    )  # fmt: skip


def fresh_walker(gait: Gait, ahead: float, path: Array) -> Array:
    """Numbers of a walker at rest: s = 0, on a packed path that is laid `ahead` [m] of it."""
    numbers = np.zeros(_PATH + PACKED_PATH)
    walker = walker_at.py_func(numbers, 0)
    walker.argument[1], walker.argument[3] = float(gait.flies), 1.0
    walker.goal[0], walker.time[0] = ahead, np.nan
    walker.flight[:], walker.path[:] = fresh_decision(gait.flies), path
    return numbers


class Following(NamedTuple):
    """How a walker follows, as numbers; in an array there are the two lengths in the place of shares and stances.

    Attributes
    ----------
    rate, pull, forward, backward, turn, lateral, curvature, take_off, landing, haste : float
        ω [1/s], largest |s̈| [m/s²], speeds [m/s], Ω [rad/s], a [m/s²], κ_max [1/m], and those of its flights [m/s],
        [m/s²] (see `controllers.fields.leading.Leading`).
    ahead, decay, stride : float
        D [m], what is left of a lean after a row of the path, and the length of a lap [m].
    shares, stances : Array
        `Leading.shares` and `Gait.stances`, flat.
    """

    rate: float
    pull: float
    forward: float
    backward: float
    turn: float
    lateral: float
    curvature: float
    take_off: float
    landing: float
    haste: float
    ahead: float
    decay: float
    stride: float
    shares: Array
    stances: Array


_NUMBERS = len(Following._fields) - 2


def packed_following(following: Following) -> Array:
    """As `following_at` takes it."""
    numbers = [float(number) for number in following[:_NUMBERS]]
    lengths = [len(following.shares), following.stances.size]
    return np.concatenate([numbers, lengths, following.shares, following.stances.ravel()])


@njit
def following_at(numbers: Array, at: int) -> Following:
    """What is packed at ``numbers[at:]``."""
    first = at + _NUMBERS + 2
    middle = first + int(numbers[first - 2])
    return Following(
        numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at + 4], numbers[at + 5],
        numbers[at + 6], numbers[at + 7], numbers[at + 8], numbers[at + 9], numbers[at + 10], numbers[at + 11],
        numbers[at + 12], numbers[first:middle], numbers[middle : middle + int(numbers[first - 1])],
    )  # fmt: skip


@njit
def walker_acceleration(lag: float, speed: float, rate: float) -> float:
    """s̈ = ω² (g − D − s) − 2 ω ṡ [m/s²], of a figure that lags by g − D − s [m] and follows with ω [1/s]."""
    return rate * rate * lag - 2.0 * rate * speed


@njit
def path_place(path: Array, s: float) -> tuple[float, float, float, float]:
    """Place [m], heading [rad] and curvature [1/m] of the path at s, within what there is of it."""
    heading, curvature = path_value(path, s, PATH_HEADING)
    return path_value(path, s, PATH_X)[0], path_value(path, s, PATH_Y)[0], heading, curvature


@njit
def _nearest(path: Array, guess: float, x: float, y: float) -> float:
    """Arc length of the place next to (x, y), near a guess, on the path and the straight line on from its front."""
    front, back = path_front(path), path_back(path)
    goal = guess
    for _ in range(_SEARCHES):
        at = min(goal, front)
        a, b, heading, curvature = path_place(path, at)
        c, s = np.cos(heading), np.sin(heading)
        along, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Newton's step, damped where the path bends round the stylus.
        stretch = max(1.0 - curvature * side, 0.3) if goal < front else 1.0
        goal = max(goal + (along - (goal - at)) / stretch, back)
    return goal


@njit
def _lay_path(follow: Following, walker: Walker, x: float, y: float) -> None:
    """Lay the path as far ahead of the figure as its feet need it, bent towards the stylus's place (x, y)."""
    path, speed, ahead = walker.path, max(walker.speed[0], 0.1), follow.ahead
    limit = min(follow.curvature, follow.turn / speed, follow.lateral / (speed * speed))
    phases = float(len(follow.shares))
    while path_front(path) < walker.argument[0] + ahead:
        a, b, heading, _ = path_place(path, path_front(path))
        c, s = np.cos(heading), np.sin(heading)
        forward, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Pure pursuit: the arc that is tangent to the path and meets the stylus.
        bend = 2.0 * side / max(forward * forward + side * side, ahead * ahead) if forward > 0.0 else 0.0
        bend = walker.bend[0] + (min(max(bend, -limit), limit) - walker.bend[0]) * STEP / _STEERING
        bend = min(max(bend, -limit), limit)
        walker.bend[0] = bend
        lap = (path[0] + 0.5) * STEP / follow.stride
        share = follow.shares[int(phases * (lap - np.floor(lap))) % int(phases)]
        lay_row(path, share * bend * STEP, abs(bend), share * bend * walker.speed[0] ** 2)
        walker.sway[0] = lean_row(path, int(ahead / STEP) - MARGIN, follow.decay, walker.sway[0])


@njit
def _bent_speed(follow: Following, path: Array, s: float, speed: float) -> float:
    """Largest speed at s [m/s] from which the figure can brake for every bend that lies before it."""
    pull, front = min(follow.pull, follow.haste), path[0]
    square = follow.forward**2
    rows = int(0.5 * speed * speed / (pull * STEP)) + 6
    first = np.floor(s / STEP) - 2.0 if speed > 0.0 else np.floor(s / STEP) - rows + 4.0
    for k in range(rows):
        row = min(max(first + k, front - ROWS + 1.0), front)
        bend = max(path[1 + ROW * (int(row) % ROWS) + PATH_BEND], 1e-9)
        # The turn to a row from the one before is made over three steps.
        distance = max(abs(s / STEP - row + 0.5) - 1.5, 0.0) * STEP
        most = min((follow.turn / bend) ** 2, follow.lateral / bend)
        square = min(square, most + 2.0 * pull * distance)
    return np.sqrt(square)


@njit
def _walk(follow: Following, walker: Walker, dt: float) -> None:
    """The figure follows with inertia: s̈ = ω² (g − D − s) − 2 ω ṡ, bounded, and slower where the path bends."""
    on_ground = walker.argument[1] > 0.5 or len(follow.stances) == 0
    pull = follow.pull if on_ground else follow.haste
    s, speed = walker.argument[0], walker.speed[0]
    acceleration = walker_acceleration(walker.goal[0] - follow.ahead - s, speed, follow.rate)
    speed += dt * min(max(acceleration, -pull), pull)
    most = _bent_speed(follow, walker.path, s, speed)
    speed = min(max(speed, -follow.backward, -most), most)
    s += dt * speed
    least = path_back(walker.path) + follow.ahead
    if s < least:
        s, speed = least, 0.0
    walker.argument[0], walker.speed[0] = s, speed


@njit
def _decide_flight(follow: Following, walker: Walker) -> None:
    """How far the figure stays on the ground, by its place in the lap and its pace (see `controllers.walking.gait`)."""
    share = share_of_stance(follow.stances, walker.argument[0] / follow.stride)
    walker.argument[1] = decide_flight(
        walker.flight, share, walker.speed[0], follow.take_off, follow.landing
    )  # fmt: skip


@njit
def lead(follow: Following, walker: Walker, time: float, x: float, y: float) -> None:
    """Move a walker on to a time [s], towards the stylus's place (x, y) on the floor [m]; all must be finite."""
    walker.goal[0] = _nearest(walker.path, walker.goal[0], x, y)
    dt = time - walker.time[0]
    walker.time[0] = time
    # False for NaN, the first tick.
    if dt > 0.0:
        _walk(follow, walker, min(dt, _LONGEST_TICK))
        _decide_flight(follow, walker)
        _lay_path(follow, walker, x, y)
