r"""State and dynamics of a walker (a led figure): its arc length and speed on its path, and the laying of the path.

The figure walks on its own path A(s) (`controllers.walking.walked_path`) at the arc length s, and its pose is a
function of s (and u). So walking backwards is a decrease of s, and the same poses return. The servo advances the walker
before the field (`controllers.walking.walking`); the law of force (`controllers.fields.leading`) and the haptic map
(`controllers.haptic_map.led`) read it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.state import MAX_TIME_STEP
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
from geometry.arrays import Array

_ARGUMENT_SIZE = 7
_FLIGHT_OFFSET = _ARGUMENT_SIZE + 5
_PATH_OFFSET = _FLIGHT_OFFSET + DECISION
_NEWTON_STEPS = 4  # Newton steps of the warm-started search for the nearest point
_STEERING_LENGTH = 0.15  # [m] path length constant with which the curvature follows the stylus
RESERVE_ROWS = 4  # spare rows of path, since the filter before the map may evaluate it ahead of the walker


class Walker(NamedTuple):
    """State of a walker: views of one array of numbers.

    Attributes
    ----------
    argument : Array, shape (7,)
        Argument of the haptic map, ``[s, u, 0, 1, 0, 0, 0]``: arc length [m], and share of the grounded form, 0 to 1.
    speed : Array, shape (1,)
        ṡ [m/s].
    goal : Array, shape (1,)
        g, arc length of the path's point nearest to the stylus [m].
    time : Array, shape (1,)
        Time of the last tick [s].
    bend : Array, shape (1,)
        Curvature with which the path is laid [1/m].
    sway : Array, shape (1,)
        Running sum of the lateral accelerations for the lean [m/s²] (see `lean_row`).
    flight : Array, shape (4,)
        Decision on the next flight phase (see `controllers.walking.gait`).
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
    one = at + _ARGUMENT_SIZE
    return Walker(
        numbers[at:one], numbers[one : one + 1], numbers[one + 1 : one + 2], numbers[one + 2 : one + 3],
        numbers[one + 3 : one + 4], numbers[one + 4 : one + 5], numbers[at + _FLIGHT_OFFSET : at + _PATH_OFFSET],
        numbers[at + _PATH_OFFSET : at + _PATH_OFFSET + PACKED_PATH],
    )  # fmt: skip


def fresh_walker(gait: Gait, ahead: float, path: Array) -> Array:
    """Numbers of a walker at rest at s = 0, on a packed path that is laid up to `ahead` [m]."""
    numbers = np.zeros(_PATH_OFFSET + PACKED_PATH)
    walker = walker_at.py_func(numbers, 0)
    walker.argument[1], walker.argument[3] = float(gait.flies), 1.0
    walker.goal[0], walker.time[0] = ahead, np.nan
    walker.flight[:], walker.path[:] = fresh_decision(gait.flies), path
    return numbers


class Following(NamedTuple):
    """Parameters of a walker; packed as the scalars, the lengths of `shares` and `stances`, then these arrays.

    Attributes
    ----------
    rate, pull, forward, backward, turn, lateral, curvature, take_off, landing, flight_pull : float
        ω [1/s], largest |s̈| [m/s²], largest speeds [m/s], Ω [rad/s], a [m/s²], κ_max [1/m], speeds of take-off and
        landing [m/s], largest |s̈| with flight phases [m/s²] (see `controllers.walking.walking.Walking`).
    ahead, decay, stride : float
        D [m], decay factor of the lean per row of the path, and path length of a lap [m].
    shares, stances : Array
        `Walking.shares` and `Gait.stances`, flattened.
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
    flight_pull: float
    ahead: float
    decay: float
    stride: float
    shares: Array
    stances: Array


_SCALAR_COUNT = len(Following._fields) - 2


def packed_following(following: Following) -> Array:
    """The parameters as an array for `following_at`."""
    numbers = [float(number) for number in following[:_SCALAR_COUNT]]
    lengths = [len(following.shares), following.stances.size]
    return np.concatenate([numbers, lengths, following.shares, following.stances.ravel()])


@njit
def following_at(numbers: Array, at: int) -> Following:
    """Parameters packed at ``numbers[at:]``."""
    first = at + _SCALAR_COUNT + 2
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
    """Position x, y [m], heading [rad] and curvature [1/m] of the path at s, clamped to the stored path."""
    heading, curvature = path_value(path, s, PATH_HEADING)
    return path_value(path, s, PATH_X)[0], path_value(path, s, PATH_Y)[0], heading, curvature


@njit
def _nearest_arc_length(path: Array, guess: float, x: float, y: float) -> float:
    """Arc length of the point nearest to (x, y), near a guess, on the path or its straight continuation."""
    front, back = path_front(path), path_back(path)
    goal = guess
    for _ in range(_NEWTON_STEPS):
        at = min(goal, front)
        a, b, heading, curvature = path_place(path, at)
        c, s = np.cos(heading), np.sin(heading)
        along, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Newton's step, damped where the path bends round the stylus.
        stretch = max(1.0 - curvature * side, 0.3) if goal < front else 1.0
        goal = max(goal + (along - (goal - at)) / stretch, back)
    return goal


@njit
def _extend_path(follow: Following, walker: Walker, x: float, y: float) -> None:
    """Extend the path up to D ahead of the figure, towards the stylus's point (x, y) on the floor by pure pursuit."""
    path, speed, ahead = walker.path, max(walker.speed[0], 0.1), follow.ahead
    limit = min(follow.curvature, follow.turn / speed, follow.lateral / (speed * speed))
    phases = float(len(follow.shares))
    while path_front(path) < walker.argument[0] + ahead:
        a, b, heading, _ = path_place(path, path_front(path))
        c, s = np.cos(heading), np.sin(heading)
        forward, side = c * (x - a) + s * (y - b), c * (y - b) - s * (x - a)
        # Pure pursuit: the arc that is tangent to the path and passes through the stylus's point.
        bend = 2.0 * side / max(forward * forward + side * side, ahead * ahead) if forward > 0.0 else 0.0
        bend = walker.bend[0] + (min(max(bend, -limit), limit) - walker.bend[0]) * STEP / _STEERING_LENGTH
        bend = min(max(bend, -limit), limit)
        walker.bend[0] = bend
        lap = (path[0] + 0.5) * STEP / follow.stride
        share = follow.shares[int(phases * (lap - np.floor(lap))) % int(phases)]
        lay_row(path, share * bend * STEP, abs(bend), share * bend * walker.speed[0] ** 2)
        walker.sway[0] = lean_row(path, int(ahead / STEP) - RESERVE_ROWS, follow.decay, walker.sway[0])


@njit
def _speed_limit(follow: Following, path: Array, s: float, speed: float) -> float:
    """Largest speed at s [m/s] from which the figure can brake for every bend ahead in its direction of motion."""
    pull, front = min(follow.pull, follow.flight_pull), path[0]
    square = follow.forward**2
    rows = int(0.5 * speed * speed / (pull * STEP)) + 6
    first = np.floor(s / STEP) - 2.0 if speed > 0.0 else np.floor(s / STEP) - rows + 4.0
    for k in range(rows):
        row = min(max(first + k, front - ROWS + 1.0), front)
        bend = max(path[1 + ROW * (int(row) % ROWS) + PATH_BEND], 1e-9)
        # The turn from one row to the next extends over three steps.
        distance = max(abs(s / STEP - row + 0.5) - 1.5, 0.0) * STEP
        limit = min((follow.turn / bend) ** 2, follow.lateral / bend)
        square = min(square, limit + 2.0 * pull * distance)
    return np.sqrt(square)


@njit
def _integrate_motion(follow: Following, walker: Walker, dt: float) -> None:
    """Integrate s̈ = ω² (g − D − s) − 2 ω ṡ over `dt` [s], with bounded |s̈| and a speed limit where the path bends."""
    on_ground = walker.argument[1] > 0.5 or len(follow.stances) == 0
    pull = follow.pull if on_ground else follow.flight_pull
    s, speed = walker.argument[0], walker.speed[0]
    acceleration = walker_acceleration(walker.goal[0] - follow.ahead - s, speed, follow.rate)
    speed += dt * min(max(acceleration, -pull), pull)
    limit = _speed_limit(follow, walker.path, s, speed)
    speed = min(max(speed, -follow.backward, -limit), limit)
    s += dt * speed
    lowest = path_back(walker.path) + follow.ahead
    if s < lowest:
        s, speed = lowest, 0.0
    walker.argument[0], walker.speed[0] = s, speed


@njit
def _update_flight(follow: Following, walker: Walker) -> None:
    """Update u by the phase of the lap and the speed (see `controllers.walking.gait`)."""
    share = share_of_stance(follow.stances, walker.argument[0] / follow.stride)
    walker.argument[1] = decide_flight(walker.flight, share, walker.speed[0], follow.take_off, follow.landing)


@njit
def lead(follow: Following, walker: Walker, time: float, x: float, y: float) -> None:
    """Advance a walker to a time [s], towards the stylus's point (x, y) on the floor [m]; all must be finite."""
    walker.goal[0] = _nearest_arc_length(walker.path, walker.goal[0], x, y)
    dt = time - walker.time[0]
    walker.time[0] = time
    # The comparison is false for the NaN of the first tick.
    if dt > 0.0:
        _integrate_motion(follow, walker, min(dt, MAX_TIME_STEP))
        _update_flight(follow, walker)
        _extend_path(follow, walker, x, y)
