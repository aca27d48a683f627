"""Motor planning of a person: when a submovement begins, its goal and duration, and the scatter of its endpoint."""

import math

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from sim.users.person import person_state as at
from sim.users.person.person_state import PersonState
from sim.users.person.random_numbers import normal
from sim.users.person.submovement import aimed_seconds, set_submovement, submovement
from sim.users.person.wishes import PLACE

CROSS_SCATTER = 0.85  # endpoint scatter across over along the direction (< 1: Gordon et al. 1994 I; value from memory)
MIN_SUBMOVEMENT_TIME = 0.16  # [s] duration of the shortest submovement
SEEN_FRACTION = 0.8  # share of a submovement's duration (94 % of its length) after which its endpoint can be seen
MAX_DEVIATION, REACTION_TIME = 0.004, 0.08  # deviation from the plan that is corrected [m], and the delay [s]


@njit
def may_decide(person: PersonState, waits: bool) -> bool:
    """Whether a new submovement may begin: in the second half of the last one, or earlier after a deviation from it.

    A person who aims at a target waits (`waits`) until she has seen where the last submovement ends.
    """
    n, m, V = person.numbers, person.memory, person.vectors
    now = m[at.TICKS] * n[at.PERIOD]
    if now - m[at.DECIDED] < n[at.REFRACTORY]:
        return False
    elapsed = now - m[at.BEGUN]
    if waits:
        return m[at.LASTS] == 0.0 or elapsed >= max(
            m[at.LASTS], SEEN_FRACTION * m[at.LASTS] + n[at.PERIOD] * n[at.SEEN_TICKS]
        )
    if m[at.LASTS] == 0.0 or elapsed >= m[at.LASTS]:
        return True
    believed = work_array((3, 3))
    submovement(person.plans[1], m[at.LASTS], elapsed, believed)
    squared_deviation = 0.0
    for k in range(3):
        squared_deviation += (V[at.BELIEF, k] - believed[0, k]) ** 2
    if squared_deviation < MAX_DEVIATION * MAX_DEVIATION:
        m[at.CALM] = now
    return elapsed >= 0.5 * m[at.LASTS] or now - m[at.CALM] > REACTION_TIME


@njit
def aim(person: PersonState, goal: Array, width: float) -> bool:
    """Begin a submovement to a target; returns True, and begins none, if the target is already reached.

    A target is a strip across the line from the previous target, as in Fitts 1954; the first one is a ball.
    """
    n, V, rows, turn = person.numbers, person.vectors, person.wishes, int(person.memory[at.TARGET])
    distance, along, squared_spacing = 0.0, 0.0, 0.0
    for k in range(3):
        distance += (goal[0, k] - V[at.BELIEF, k]) ** 2
        if 0 < turn < rows.shape[0]:
            spacing = rows[turn, PLACE + k] - rows[turn - 1, PLACE + k]
            along += spacing * (goal[0, k] - V[at.BELIEF, k])
            squared_spacing += spacing * spacing
    distance = math.sqrt(distance) if squared_spacing == 0.0 else abs(along) / math.sqrt(squared_spacing)
    if distance < 0.5 * width:
        return True
    overhead = n[at.PERIOD] * n[at.SEEN_TICKS]
    seconds = aimed_seconds(2.0 * distance / width, n[at.CAUTION] * n[at.MOTOR_NOISE], overhead, MIN_SUBMOVEMENT_TIME)
    submove(person, goal, seconds)
    return False


@njit
def submove(person: PersonState, goal: Array, seconds: float) -> None:
    r"""Begin a submovement from the believed place of the hand to a goal.

    Its endpoint scatters with σ = K A/D along its direction and less across (`CROSS_SCATTER`), A its length and D its
    duration (Schmidt et al. 1979; ellipses of endpoints: Gordon et al. 1994), because the noise of a motor command
    grows with the command (Harris & Wolpert 1998).
    """
    n, m, V = person.numbers, person.memory, person.vectors
    start, end, displacement, length = work_array((3, 3)), work_array((3, 3)), work_array(3), 0.0
    end[:] = goal
    for k in range(3):
        displacement[k] = goal[0, k] - V[at.BELIEF, k]
        length += displacement[k] * displacement[k]
    length = math.sqrt(length)
    start[0], start[1], start[2] = V[at.BELIEF], V[at.DRIVEN_V], V[at.DRIVEN_A]
    set_submovement(person.plans[1], start, goal, seconds)
    scatter = n[at.MOTOR_NOISE] * length / seconds
    across = CROSS_SCATTER * scatter
    along = math.sqrt(scatter * scatter - across * across) * normal(person.rng)
    for k in range(3):
        unit = displacement[k] / length if length > 0.0 else 0.0
        error = along * unit + across * normal(person.rng)
        end[0, k] += n[at.CORRECTION] * (V[at.DRIVEN_P, k] - V[at.BELIEF, k]) + error
    start[0] = V[at.DRIVEN_P]
    set_submovement(person.plans[0], start, end, seconds)
    m[at.LASTS], m[at.BEGUN] = seconds, m[at.TICKS] * n[at.PERIOD]
    m[at.DECIDED] = m[at.BEGUN]


@njit
def drive(person: PersonState) -> None:
    """Follow the submovement in progress, and accumulate the intended displacement."""
    n, m, V = person.numbers, person.memory, person.vectors
    if m[at.LASTS] == 0.0:
        return
    state = work_array((3, 3))
    elapsed = m[at.TICKS] * n[at.PERIOD] - m[at.BEGUN]
    submovement(person.plans[1], m[at.LASTS], elapsed, state)
    for k in range(3):
        V[at.INTENDED, k] += n[at.PERIOD] * state[1, k]
    submovement(person.plans[0], m[at.LASTS], elapsed, state)
    V[at.DRIVEN_P], V[at.DRIVEN_V], V[at.DRIVEN_A] = state[0], state[1], state[2]
