"""A person's decisions at a tick: reading her wish, starting submovements, adapting her clock, learning forces."""

import math

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from sim.users.person import person_state as at
from sim.users.person.body import REFERENCE_GRIP
from sim.users.person.motor_plan import aim, drive, may_decide, submove
from sim.users.person.person_state import PersonState
from sim.users.person.wishes import ENGAGED, FORCE, PLACE, SWITCH, WIDTH, call_intent, wanted_motion
from sim.users.person.wishes import GRIP as WISHED_GRIP

ENGAGING_TIME = 0.1  # [s] time constant of muscle activation: electromechanical delay and rise
YIELDING_TIME = 0.15  # [s] time constant with which a relaxed arm's rest position follows the hand
RETENTION = 0.99  # A, share of what was learned that is retained per repetition: slow process of Smith et al. 2006 (m)
# [s] half-width of the velocity difference that estimates a path's acceleration: a third of a submovement
DIFFERENCE_HALF_WIDTH = 0.1


@njit
def act_on_wish(person: PersonState, switch: Array) -> None:
    """Read the current wish, begin a submovement if one is due, and follow the one in progress."""
    n, m, V, rows = person.numbers, person.memory, person.vectors, person.wishes
    wanted, goal = work_array((3, 3)), work_array((3, 3))
    wanted[:], goal[:] = 0.0, 0.0
    has_targets, is_user_defined = n[at.WISH_PERIOD] == 0.0, n[at.WISH_PERIOD] < 0.0
    if is_user_defined:
        if person.units[1] != 0:
            call_intent(person.units[1], (m[at.TICKS] * n[at.PERIOD], V[at.BELIEF], V[at.FELT_FORCE], rows))
        row = rows[0]
        wanted[0], wanted[1], goal[1] = row[PLACE : PLACE + 3], rows[1, PLACE : PLACE + 3], rows[1, PLACE : PLACE + 3]
        for k in range(3):
            goal[0, k] = wanted[0, k] + n[at.HORIZON] * wanted[1, k]
        switch[0] = row[SWITCH]
    elif has_targets:
        row = rows[min(int(m[at.TARGET]), rows.shape[0] - 1)]
        wanted[0], goal[0] = row[PLACE : PLACE + 3], row[PLACE : PLACE + 3]
        switch[0] = 0.0
    else:
        row = rows[wanted_motion(rows, n[at.WISH_PERIOD], m[at.CLOCK], wanted)]
        _predict_wanted_motion(rows, n[at.WISH_PERIOD], m[at.CLOCK] + n[at.HORIZON], goal)
        switch[0] = row[SWITCH]
    engaged = row[ENGAGED] > 0.0
    m[at.CLOCK] += n[at.PERIOD] * (
        1.0 + _clock_speed_up(n[at.ENTRAINMENT], V[at.BELIEF], wanted) if engaged and n[at.WISH_PERIOD] > 0.0 else 1.0
    )
    grip = n[at.GRIP] if math.isnan(row[WISHED_GRIP]) else row[WISHED_GRIP]
    activation_step = n[at.PERIOD] / ENGAGING_TIME
    m[at.ENGAGED_SHARE] += activation_step * ((1.0 if engaged else 0.0) - m[at.ENGAGED_SHARE])
    m[at.STIFFNESS_FACTOR] += activation_step * (
        max(1.0 + n[at.STIFFENING] * (grip - REFERENCE_GRIP), 0.2) - m[at.STIFFNESS_FACTOR]
    )
    for k in range(3):
        V[at.WANTED_FORCE, k] += activation_step * (row[FORCE + k] - V[at.WANTED_FORCE, k])
    if not engaged:
        _relax_arm(person)
        return
    if has_targets:
        if may_decide(person, True) and aim(person, goal, row[WIDTH]):
            m[at.TARGET] += 1.0
            switch[0] = 1.0
    elif may_decide(person, False):
        submove(person, goal, n[at.HORIZON])
    drive(person)
    _learn_force(person, wanted)


@njit
def _predict_wanted_motion(rows: Array, period: float, t: float, goal: Array) -> None:
    """Set the motion wanted at time t [s]; its acceleration is the mean over ± `DIFFERENCE_HALF_WIDTH`."""
    before, acceleration = work_array((3, 3)), work_array(3)
    before[:] = 0.0
    wanted_motion(rows, period, t - DIFFERENCE_HALF_WIDTH, before)
    wanted_motion(rows, period, t + DIFFERENCE_HALF_WIDTH, goal)
    for k in range(3):
        acceleration[k] = (goal[1, k] - before[1, k]) / (2.0 * DIFFERENCE_HALF_WIDTH)
    wanted_motion(rows, period, t, goal)
    goal[2] = acceleration


@njit
def _clock_speed_up(entrainment: float, place: Array, wanted: Array) -> float:
    """Relative speed-up of her clock [1], −0.5 to 0.5: positive if the hand is ahead of the wanted motion."""
    speed, lead = 0.0, 0.0
    for k in range(3):
        speed += wanted[1, k] * wanted[1, k]
        lead += wanted[1, k] * (place[k] - wanted[0, k])
    return 0.0 if speed < 1e-6 else min(max(entrainment * lead / speed, -0.5), 0.5)


@njit
def _relax_arm(person: PersonState) -> None:
    """Be passive: the arm's rest position follows the believed position of the hand."""
    n, m, V = person.numbers, person.memory, person.vectors
    for k in range(3):
        V[at.DRIVEN_P, k] += n[at.PERIOD] / YIELDING_TIME * (V[at.BELIEF, k] - V[at.DRIVEN_P, k])
    V[at.DRIVEN_V], V[at.DRIVEN_A] = 0.0, 0.0
    m[at.LASTS], m[at.DECIDED] = 0.0, m[at.TICKS] * n[at.PERIOD] - n[at.REFRACTORY]


@njit
def _learn_force(person: PersonState, wanted: Array) -> None:
    r"""Learn the force that keeps the hand on the wanted motion, for each part of a lap.

    .. math:: f_{n+1} = A f_n + B K (p_d - p)

    per repetition (Thoroughman & Shadmehr 2000). The learned force is applied earlier by the time constant of
    muscle activation.
    """
    n, m, V = person.numbers, person.memory, person.vectors
    if n[at.LEARNING] == 0.0 or n[at.LAP] == 0.0:
        return
    part, activated_part = _lap_part(m[at.CLOCK] / n[at.LAP]), _lap_part((m[at.CLOCK] + ENGAGING_TIME) / n[at.LAP])
    share = n[at.PERIOD] * at.LEARNED_PARTS / n[at.LAP]
    for k in range(3):
        pull = 0.0
        for j in range(3):
            pull += person.stiffness[k, j] * (wanted[0, j] - V[at.BELIEF, j])
        person.learned[part, k] += share * (n[at.LEARNING] * pull - (1.0 - RETENTION) * person.learned[part, k])
        V[at.WANTED_FORCE, k] += n[at.PERIOD] / ENGAGING_TIME * person.learned[activated_part, k]


@njit
def _lap_part(laps: float) -> int:
    """Index of the part of a lap after a number of laps."""
    return int(at.LEARNED_PARTS * (laps - math.floor(laps))) % at.LEARNED_PARTS
