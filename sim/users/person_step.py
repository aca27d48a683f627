"""A person's time step: senses and decides once a servo tick, moves her arm at every physics step.

She gets what a person gets: force and motion of the stylus with noise and a reflex's delay, what she sees with a
sight's delay, and what she wants. No field, no phase, no limiter reaches her.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from sim.users.body import REFERENCE_GRIP
from sim.users.chance import normal
from sim.users.eye import seen_place
from sim.users.own_intent import call_intent
from sim.users.person_state import (
    BEGUN,
    BELIEF,
    BLUR,
    CALM,
    CAPACITY,
    CAUTION,
    CLOCK,
    CORRECTION,
    DECIDED,
    DEVIATING,
    DEVIATION,
    DRIFT,
    DRIVEN_A,
    DRIVEN_P,
    DRIVEN_V,
    ENGAGED_SHARE,
    ENTRAINMENT,
    FATIGUE,
    FELT_FORCE,
    FELT_NOISE,
    FORCE_NOISE,
    GRIP,
    GRIP_DAMPING,
    GRIP_STIFFNESS,
    HAND_P,
    HAND_V,
    HORIZON,
    INTENDED,
    INTENT,
    LAP,
    LASTS,
    LEARNED_PARTS,
    LEARNING,
    LOOK_TICKS,
    MOTOR_NOISE,
    OFFSET,
    PERIOD,
    PRESSED,
    REFLEX,
    REFLEX_GAIN,
    REFLEX_TICKS,
    REFRACTORY,
    SEEN,
    SEEN_NOISE,
    SEEN_TICKS,
    SENSED,
    SHOWN,
    SIGHTED,
    SKILL,
    STARTED,
    STIFFENING,
    STIFFER,
    STRENGTH,
    TARGET,
    TICKS,
    TREMOR,
    TREMOR_A,
    TREMOR_B,
    TREMOR_BEFORE,
    TREMOR_GAIN,
    UNSTEADY,
    WANTED_FORCE,
    WISH_PERIOD,
    PersonState,
)
from sim.users.submovement import aimed_seconds, set_submovement, submovement
from sim.users.wishes import ENGAGED, FORCE, PLACE, SWITCH, WIDTH, wanted_motion
from sim.users.wishes import GRIP as WISHED_GRIP

Array = npt.NDArray[np.float64]

DRIFT_TIME = 60.0  # [s] in which the felt place of an unseen hand drifts: 15 to 120 s (Wann & Ibrahim 1992, m)
BLUR_TIME = 0.2  # [s] of what is seen: a fixation
CALIBRATION_TIME = 0.15  # [s] within which sight corrects what is felt
UNSTEADY_TIME = 0.1  # [s] of noise of force: mostly below 2 Hz (Jones et al. 2002, m)
ENGAGING_TIME = 0.1  # [s] in which muscles are activated: electromechanical delay and rise
YIELDING_TIME = 0.15  # [s] in which a relaxed arm takes the place where it was moved to for its own
SLACK, LOOSE = 0.08, 0.3  # shares of stiffness and damping that a relaxed arm keeps: passive tissue
ACROSS = 0.85  # scatter of endpoints across the way over that along it (Gordon et al. 1994: ellipses along the way, m)
LEAST_SECONDS = 0.16  # [s] of the shortest submovement
WATCHED = 0.8  # of a submovement's time: 94 % of its way, by which it is seen where it ends
BEND = 0.1  # [s] before and after which she looks at a way to see how it bends: a third of a submovement
SURPRISE, REACTION = 0.004, 0.08  # [m] from where it should be, a hand is looked after within so long [s]
RECOVERY = 2.4  # [1/min] at which force comes back (Liang et al. 2009, m)


@njit
def person_step(
    person: PersonState, t: float, dt: float, substep: int, p: Array, v: Array, force: Array, switch: Array
) -> None:
    """Set the force of a person's hand on the stylus, and the switch.

    Parameters
    ----------
    person : PersonState
        Updated.
    t, dt : float
        Time, and the physics step [s].
    substep : int
        Number of the physics step within the servo tick.
    p, v : Array
        True position [m] and velocity [m/s] of the stylus in H, shape (3,).
    force : Array
        That of the last step [N], in H; set to that of this one, shape (3,).
    switch : Array
        Set to 1 while the switch is pressed, shape (1,).
    """
    if substep == 0:
        if person.memory[STARTED] == 0.0:
            _begin(person, p, v)
        _sense(person, p, force)
        _want(person, switch)
    _move(person, dt, p, v, force)


@njit
def _begin(person: PersonState, p: Array, v: Array) -> None:
    """Begin where the stylus is, at its speed."""
    memory, vectors = person.memory, person.vectors
    vectors[:] = 0.0
    for place in (HAND_P, DRIVEN_P, BELIEF, SHOWN):
        vectors[place] = p
    vectors[HAND_V] = v
    for row in range(person.past.shape[0]):
        person.past[row, SENSED : SENSED + 3] = p
        person.past[row, SEEN : SEEN + 3] = p
    memory[STARTED], memory[CAPACITY] = 1.0, 1.0
    memory[STIFFER] = 1.0 + person.numbers[STIFFENING] * (person.numbers[GRIP] - REFERENCE_GRIP)
    memory[DECIDED], memory[SIGHTED] = -person.numbers[REFRACTORY], -1.0


@njit
def _noise(person: PersonState, which: int, deviation: float, seconds: float) -> None:
    """A step of a noise whose standard deviation and correlation time are given (an Ornstein–Uhlenbeck process)."""
    kept = math.exp(-person.numbers[PERIOD] / seconds)
    fresh = deviation * math.sqrt(1.0 - kept * kept)
    for k in range(3):
        person.vectors[which, k] = kept * person.vectors[which, k] + fresh * normal(person.chance)


@njit
def _sense(person: PersonState, p: Array, force: Array) -> None:
    """Note what is felt and seen, and make of what arrives now where the hand is believed to be."""
    n, m, V, past = person.numbers, person.memory, person.vectors, person.past
    _noise(person, DRIFT, n[FELT_NOISE], DRIFT_TIME)
    _noise(person, BLUR, n[SEEN_NOISE], BLUR_TIME)
    _noise(person, UNSTEADY, n[FORCE_NOISE], UNSTEADY_TIME)
    size = past.shape[0]
    tick = int(m[TICKS])
    now = past[tick % size]
    felt, seen = past[(tick - int(n[REFLEX_TICKS])) % size], past[(tick - int(n[SEEN_TICKS])) % size]
    _look(person, p)
    kept = math.exp(-n[PERIOD] / CALIBRATION_TIME)
    for k in range(3):
        now[SENSED + k], now[SEEN + k] = V[HAND_P, k] + V[DRIFT, k], V[SHOWN, k] + V[BLUR, k]
        now[DEVIATION + k] = V[DRIVEN_P, k] - V[HAND_P, k]
        now[DEVIATING + k] = V[DRIVEN_V, k] - V[HAND_V, k]
        now[INTENT + k], now[PRESSED + k] = V[INTENDED, k], force[k]
        V[OFFSET, k] = kept * V[OFFSET, k] + (1.0 - kept) * (seen[SEEN + k] - seen[SENSED + k])
        V[BELIEF, k] = felt[SENSED + k] + V[OFFSET, k] + V[INTENDED, k] - felt[INTENT + k]
        V[FELT_FORCE, k] = felt[PRESSED + k]
    for k in range(3):
        V[REFLEX, k] = 0.0
        for j in range(3):
            V[REFLEX, k] += person.stiffness[k, j] * felt[DEVIATION + j] + person.damping[k, j] * felt[DEVIATING + j]
        V[REFLEX, k] *= n[REFLEX_GAIN]
    wave = n[TREMOR_GAIN]
    for k in range(3):
        fresh = n[TREMOR_A] * V[TREMOR, k] + n[TREMOR_B] * V[TREMOR_BEFORE, k] + wave * normal(person.chance)
        V[TREMOR_BEFORE, k], V[TREMOR, k] = V[TREMOR, k], fresh
    m[TICKS] += 1.0


@njit
def _look(person: PersonState, p: Array) -> None:
    """Look at the figure, or at the stylus (p) where there is none."""
    m, V, eye = person.memory, person.vectors, person.eye
    if eye.pose.shape[0] == 0:
        V[SHOWN] = p
    elif int(m[TICKS]) % int(person.numbers[LOOK_TICKS]) == 0:
        m[SIGHTED] = seen_place(eye, int(m[SIGHTED]), np.empty(eye.inverses.shape[2]), V[SHOWN])


@njit
def _want(person: PersonState, switch: Array) -> None:
    """Read what is wanted now, decide on a submovement if it is time to, and follow the one that is under way."""
    n, m, V, rows = person.numbers, person.memory, person.vectors, person.wishes
    wanted, goal = np.zeros((3, 3)), np.zeros((3, 3))
    aims, owns = n[WISH_PERIOD] == 0.0, n[WISH_PERIOD] < 0.0
    if owns:
        if person.units[1] != 0:
            call_intent(person.units[1], (m[TICKS] * n[PERIOD], V[BELIEF], V[FELT_FORCE], rows))
        row = rows[0]
        wanted[0], wanted[1], goal[1] = row[PLACE : PLACE + 3], rows[1, PLACE : PLACE + 3], rows[1, PLACE : PLACE + 3]
        for k in range(3):
            goal[0, k] = wanted[0, k] + n[HORIZON] * wanted[1, k]
        switch[0] = row[SWITCH]
    elif aims:
        row = rows[min(int(m[TARGET]), rows.shape[0] - 1)]
        wanted[0], goal[0] = row[PLACE : PLACE + 3], row[PLACE : PLACE + 3]
        switch[0] = 0.0
    else:
        row = rows[wanted_motion(rows, n[WISH_PERIOD], m[CLOCK], wanted)]
        _foresee(rows, n[WISH_PERIOD], m[CLOCK] + n[HORIZON], goal)
        switch[0] = row[SWITCH]
    engaged = row[ENGAGED] > 0.0
    m[CLOCK] += n[PERIOD] * (
        1.0 + _ahead(n[ENTRAINMENT], V[BELIEF], wanted) if engaged and n[WISH_PERIOD] > 0.0 else 1.0
    )
    grip = n[GRIP] if math.isnan(row[WISHED_GRIP]) else row[WISHED_GRIP]
    follow = n[PERIOD] / ENGAGING_TIME
    m[ENGAGED_SHARE] += follow * ((1.0 if engaged else 0.0) - m[ENGAGED_SHARE])
    m[STIFFER] += follow * (max(1.0 + n[STIFFENING] * (grip - REFERENCE_GRIP), 0.2) - m[STIFFER])
    for k in range(3):
        V[WANTED_FORCE, k] += follow * (row[FORCE + k] - V[WANTED_FORCE, k])
    if not engaged:
        _yield(person)
        return
    if aims:
        if _may_decide(person, True) and _aim(person, goal, row[WIDTH]):
            m[TARGET] += 1.0
            switch[0] = 1.0
    elif _may_decide(person, False):
        _submove(person, goal, n[HORIZON])
    _drive(person)
    _learn(person, wanted)


@njit
def _foresee(rows: Array, period: float, t: float, goal: Array) -> None:
    """Set the motion that will be wanted at a time [s]; no corner of it asks for more than `BEND` allows."""
    before = np.zeros((3, 3))
    wanted_motion(rows, period, t - BEND, before)
    wanted_motion(rows, period, t + BEND, goal)
    bend = (goal[1] - before[1]) / (2.0 * BEND)
    wanted_motion(rows, period, t, goal)
    goal[2] = bend


@njit
def _ahead(entrainment: float, place: Array, wanted: Array) -> float:
    """By how much her clock runs faster [1]: a motion that is ahead of what was wanted takes it along."""
    speed, way = 0.0, 0.0
    for k in range(3):
        speed += wanted[1, k] * wanted[1, k]
        way += wanted[1, k] * (place[k] - wanted[0, k])
    return 0.0 if speed < 1e-6 else min(max(entrainment * way / speed, -0.5), 0.5)


@njit
def _yield(person: PersonState) -> None:
    """Let the hand go where it goes: the arm takes the place where it is believed to be for its own."""
    n, m, V = person.numbers, person.memory, person.vectors
    for k in range(3):
        V[DRIVEN_P, k] += n[PERIOD] / YIELDING_TIME * (V[BELIEF, k] - V[DRIVEN_P, k])
    V[DRIVEN_V], V[DRIVEN_A] = 0.0, 0.0
    m[LASTS], m[DECIDED] = 0.0, m[TICKS] * n[PERIOD] - n[REFRACTORY]


@njit
def _may_decide(person: PersonState, waits: bool) -> bool:
    """Whether it is time for a new submovement: after the last one's end, or earlier if she is surprised.

    Who aims at a target `waits` until she sees where the last one ends.
    """
    n, m, V = person.numbers, person.memory, person.vectors
    now = m[TICKS] * n[PERIOD]
    if now - m[DECIDED] < n[REFRACTORY]:
        return False
    elapsed = now - m[BEGUN]
    if waits:
        return m[LASTS] == 0.0 or elapsed >= max(m[LASTS], WATCHED * m[LASTS] + n[PERIOD] * n[SEEN_TICKS])
    if m[LASTS] == 0.0 or elapsed >= m[LASTS]:
        return True
    believed = np.empty((3, 3))
    submovement(person.plans[1], m[LASTS], elapsed, believed)
    off = 0.0
    for k in range(3):
        off += (V[BELIEF, k] - believed[0, k]) ** 2
    if off < SURPRISE * SURPRISE:
        m[CALM] = now
    return elapsed >= 0.5 * m[LASTS] or now - m[CALM] > REACTION


@njit
def _aim(person: PersonState, goal: Array, width: float) -> bool:
    """Decide on a submovement to a target; whether it is reached already."""
    n, V = person.numbers, person.vectors
    away = 0.0
    for k in range(3):
        away += (goal[0, k] - V[BELIEF, k]) ** 2
    away = math.sqrt(away)
    if away < 0.5 * width:
        return True
    overhead = n[PERIOD] * n[SEEN_TICKS]
    seconds = aimed_seconds(2.0 * away / width, n[CAUTION] * n[MOTOR_NOISE], overhead, LEAST_SECONDS)
    _submove(person, goal, seconds)
    return False


@njit
def _submove(person: PersonState, goal: Array, seconds: float) -> None:
    r"""Begin a submovement from where the hand is believed to be to a goal.

    It misses by σ = K A/D along its way and 0.85 of that across (Schmidt et al. 1979; ellipses of endpoints:
    Gordon et al. 1994): the noise of a motor command
    grows with it (Harris & Wolpert 1998).
    """
    n, m, V = person.numbers, person.memory, person.vectors
    start, end = np.empty((3, 3)), goal.copy()
    way, length = np.empty(3), 0.0
    for k in range(3):
        way[k] = goal[0, k] - V[BELIEF, k]
        length += way[k] * way[k]
    length = math.sqrt(length)
    start[0], start[1], start[2] = V[BELIEF], V[DRIVEN_V], V[DRIVEN_A]
    set_submovement(person.plans[1], start, goal, seconds)
    scatter = n[MOTOR_NOISE] * length / seconds
    across = ACROSS * scatter
    along = math.sqrt(scatter * scatter - across * across) * normal(person.chance)
    for k in range(3):
        unit = way[k] / length if length > 0.0 else 0.0
        miss = along * unit + across * normal(person.chance)
        end[0, k] += n[CORRECTION] * (V[DRIVEN_P, k] - V[BELIEF, k]) + miss
    start[0] = V[DRIVEN_P]
    set_submovement(person.plans[0], start, end, seconds)
    m[LASTS], m[BEGUN] = seconds, m[TICKS] * n[PERIOD]
    m[DECIDED] = m[BEGUN]


@njit
def _drive(person: PersonState) -> None:
    """Follow the submovement that is under way, and remember how far it was meant to go."""
    n, m, V = person.numbers, person.memory, person.vectors
    if m[LASTS] == 0.0:
        return
    state = np.empty((3, 3))
    elapsed = m[TICKS] * n[PERIOD] - m[BEGUN]
    submovement(person.plans[1], m[LASTS], elapsed, state)
    for k in range(3):
        V[INTENDED, k] += n[PERIOD] * state[1, k]
    submovement(person.plans[0], m[LASTS], elapsed, state)
    V[DRIVEN_P], V[DRIVEN_V], V[DRIVEN_A] = state[0], state[1], state[2]


@njit
def _learn(person: PersonState, wanted: Array) -> None:
    """Learn the force that keeps the hand where it is wanted, for each part of a lap (Thoroughman & Shadmehr 2000)."""
    n, m, V = person.numbers, person.memory, person.vectors
    if n[LEARNING] == 0.0 or n[LAP] == 0.0:
        return
    part = int(LEARNED_PARTS * (m[CLOCK] / n[LAP] - math.floor(m[CLOCK] / n[LAP]))) % LEARNED_PARTS
    share = n[LEARNING] * n[PERIOD] * LEARNED_PARTS / n[LAP]
    for k in range(3):
        pull = 0.0
        for j in range(3):
            pull += person.stiffness[k, j] * (wanted[0, j] - V[BELIEF, j])
        person.learned[part, k] += share * pull
        V[WANTED_FORCE, k] += n[PERIOD] / ENGAGING_TIME * person.learned[part, k]


@njit
def _move(person: PersonState, dt: float, p: Array, v: Array, force: Array) -> None:
    """Muscles, arm and fingers for a physics step (semi-implicit Euler); see `sim.users.body`."""
    n, m, V = person.numbers, person.memory, person.vectors
    engaged, stiffer = m[ENGAGED_SHARE], m[STIFFER]
    spring = stiffer * (SLACK + (1.0 - SLACK) * engaged) * (1.0 - n[REFLEX_GAIN])
    damper = math.sqrt(stiffer) * (LOOSE + (1.0 - LOOSE) * engaged) * (1.0 - n[REFLEX_GAIN])
    muscle, size, held = np.empty(3), 0.0, 0.0
    for k in range(3):
        pull = V[WANTED_FORCE, k] + engaged * V[REFLEX, k]
        for j in range(3):
            pull += spring * person.stiffness[k, j] * (V[DRIVEN_P, j] - V[HAND_P, j])
            pull += damper * person.damping[k, j] * (V[DRIVEN_V, j] - V[HAND_V, j])
            pull += person.inertia[k, j] * (n[SKILL] * V[DRIVEN_A, j] + V[TREMOR, j])
        muscle[k] = pull
        size += pull * pull
    size = math.sqrt(size)
    for k in range(3):
        muscle[k] += size * V[UNSTEADY, k]
    most = n[STRENGTH] * m[CAPACITY]
    scale = min(1.0, most / max(size, 1e-12))
    for k in range(3):
        muscle[k] *= scale
        force[k] = stiffer * (n[GRIP_STIFFNESS] * (V[HAND_P, k] - p[k]) + n[GRIP_DAMPING] * (V[HAND_V, k] - v[k]))
        held += force[k] * force[k]
    held = math.sqrt(held)
    if held > n[STRENGTH]:  # the stylus slips between the fingers
        for k in range(3):
            force[k] *= n[STRENGTH] / held
    for k in range(3):
        acceleration = 0.0
        for j in range(3):
            acceleration += person.mobility[k, j] * (muscle[j] - force[j])
        V[HAND_V, k] += dt * acceleration
    for k in range(3):
        V[HAND_P, k] += dt * V[HAND_V, k]
    if n[FATIGUE] > 0.0:
        lost = n[FATIGUE] * m[CAPACITY] * min(size, most) / n[STRENGTH]
        m[CAPACITY] += dt / 60.0 * (RECOVERY * (1.0 - m[CAPACITY]) - lost)
