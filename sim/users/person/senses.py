"""Senses of a person: proprioception and vision with delay and noise, and her estimate of her hand's position.

The estimate is the delayed felt position, corrected by vision when that arrives, plus the displacement intended since
(a forward model: Miall et al. 1993, J. Mot. Behav. 25: 203-216).
"""

import math

from numba import njit

from controllers.work_array import work_array
from geometry.arrays import Array
from sim.users.person import person_state as at
from sim.users.person.eye import seen_place
from sim.users.person.person_state import PersonState
from sim.users.person.random_numbers import normal

DRIFT_TIME = 120.0  # [s] correlation time of the felt position's drift: 15 to 120 s (Wann & Ibrahim 1992, m)
BLUR_TIME = 0.2  # [s] correlation time of visual noise: a fixation
CALIBRATION_TIME = 0.15  # [s] time constant with which vision corrects the felt position
REJECTION_DISTANCE = 0.005  # [m] plus three times the felt noise: a place seen farther from the felt one is rejected
ERROR_TIME = 0.5  # [s] correlation time of the error of felt direction, without which the steering law does not hold
OFFSET_TIME = 0.5  # [s] time constant with which the position error caused by it decays
UNSTEADY_TIME = 0.1  # [s] correlation time of force noise: mostly below 2 Hz (Jones et al. 2002, m)


@njit
def sense(person: PersonState, p: Array, force: Array) -> None:
    """Store what is felt and seen now, and update the estimate, reflexes and tremor from what arrives now."""
    n, m, V, past = person.numbers, person.memory, person.vectors, person.past
    _advance_noise(person, at.DRIFT, n[at.FELT_NOISE], DRIFT_TIME)
    advance_direction_error(person)
    _advance_noise(person, at.BLUR, n[at.SEEN_NOISE], BLUR_TIME)
    _advance_noise(person, at.UNSTEADY, n[at.FORCE_NOISE], UNSTEADY_TIME)
    if n[at.WISH_PERIOD] < 0.0:  # only a user-defined intent uses the felt force
        _advance_noise(person, at.FELT_FORCE_ERROR, n[at.FELT_FORCE_NOISE], UNSTEADY_TIME)
    size = past.shape[0]
    tick = int(m[at.TICKS])
    now = past[tick % size]
    felt, seen = past[(tick - int(n[at.REFLEX_TICKS])) % size], past[(tick - int(n[at.SEEN_TICKS])) % size]
    _update_vision(person, p)
    decay = math.exp(-n[at.PERIOD] / CALIBRATION_TIME)
    for k in range(3):
        now[at.SENSED + k], now[at.SEEN + k] = (
            V[at.HAND_P, k] + V[at.DRIFT, k] + V[at.DIRECTION_ERROR_OFFSET, k],
            V[at.SHOWN, k] + V[at.BLUR, k],
        )
        now[at.DEVIATION + k] = V[at.DRIVEN_P, k] - V[at.HAND_P, k]
        now[at.DEVIATING + k] = V[at.DRIVEN_V, k] - V[at.HAND_V, k]
        now[at.INTENT + k], now[at.PRESSED + k] = V[at.INTENDED, k], force[k]
        V[at.OFFSET, k] = decay * V[at.OFFSET, k] + (1.0 - decay) * (seen[at.SEEN + k] - seen[at.SENSED + k])
        V[at.BELIEF, k] = felt[at.SENSED + k] + V[at.OFFSET, k] + V[at.INTENDED, k] - felt[at.INTENT + k]
        V[at.FELT_FORCE, k] = (1.0 + V[at.FELT_FORCE_ERROR, k]) * felt[at.PRESSED + k]
    for k in range(3):
        V[at.REFLEX, k] = 0.0
        for j in range(3):
            V[at.REFLEX, k] += (
                person.stiffness[k, j] * felt[at.DEVIATION + j] + person.damping[k, j] * felt[at.DEVIATING + j]
            )
        V[at.REFLEX, k] *= n[at.REFLEX_GAIN]
    tremor_gain = n[at.TREMOR_GAIN]
    for k in range(3):
        tremor = (
            n[at.TREMOR_A] * V[at.TREMOR, k]
            + n[at.TREMOR_B] * V[at.TREMOR_BEFORE, k]
            + tremor_gain * normal(person.rng)
        )
        V[at.TREMOR_BEFORE, k], V[at.TREMOR, k] = V[at.TREMOR, k], tremor
    m[at.TICKS] += 1.0


@njit
def _advance_noise(person: PersonState, which: int, deviation: float, seconds: float) -> None:
    """Advance a noise vector, an Ornstein–Uhlenbeck process of given standard deviation and correlation time [s]."""
    decay = math.exp(-person.numbers[at.PERIOD] / seconds)
    noise_gain = deviation * math.sqrt(1.0 - decay * decay)
    for k in range(3):
        person.vectors[which, k] = decay * person.vectors[which, k] + noise_gain * normal(person.rng)


@njit
def advance_direction_error(person: PersonState) -> None:
    r"""Advance the error e of the felt position that arises because the felt direction of a movement is wrong.

    .. math:: \dot e = \delta \times v - e / T

    with a slowly varying small rotation δ [rad]: unseen movements miss by an angle that does not depend on their length
    (Gordon, Ghilardi & Ghez 1994 I).
    """
    _advance_noise(person, at.DIRECTION_ERROR, person.numbers[at.DIRECTION_NOISE], ERROR_TIME)
    V, v, angle = person.vectors, person.vectors[at.HAND_V], person.vectors[at.DIRECTION_ERROR]
    period = person.numbers[at.PERIOD]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        V[at.DIRECTION_ERROR_OFFSET, k] += period * (
            angle[i] * v[j] - angle[j] * v[i] - V[at.DIRECTION_ERROR_OFFSET, k] / OFFSET_TIME
        )


@njit
def _update_vision(person: PersonState, p: Array) -> None:
    """Look at the figure or, if there is none, at the stylus (p)."""
    m, V, eye = person.memory, person.vectors, person.eye
    if eye.pose.shape[0] == 0:
        V[at.SHOWN] = p
    elif int(m[at.TICKS]) % int(person.numbers[at.LOOK_TICKS]) == 0:
        felt, squared_distance = work_array(3), 0.0
        for k in range(3):
            felt[k] = V[at.HAND_P, k] + V[at.DRIFT, k] + V[at.DIRECTION_ERROR_OFFSET, k]
        seen_place(eye, felt, work_array(eye.inverses.shape[2]), V[at.SHOWN])
        for k in range(3):
            squared_distance += (V[at.SHOWN, k] - felt[k]) ** 2
        if (
            squared_distance > (REJECTION_DISTANCE + 3.0 * person.numbers[at.FELT_NOISE]) ** 2
        ):  # rejected: mistaken for another pose
            V[at.SHOWN] = felt
