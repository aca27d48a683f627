"""What a person feels and sees, late and with noise, and where she believes her hand to be.

Her belief is what she feels, corrected by what she sees when that arrives, and carried on by what she intended since
(a forward model: Miall et al. 1993, J. Mot. Behav. 25: 203-216).
"""

import math

from numba import njit

from controllers.state import Array
from controllers.work_array import work_array
from sim.users.chance import normal
from sim.users.eye import seen_place
from sim.users.person_state import (
    ASTRAY,
    BELIEF,
    BLUR,
    DEVIATING,
    DEVIATION,
    DIRECTION_NOISE,
    DRIFT,
    DRIVEN_P,
    DRIVEN_V,
    FELT_FORCE,
    FELT_FORCE_NOISE,
    FELT_NOISE,
    FORCE_NOISE,
    HAND_P,
    HAND_V,
    INTENDED,
    INTENT,
    LOOK_TICKS,
    MISFELT,
    OFFSET,
    PERIOD,
    PRESSED,
    REFLEX,
    REFLEX_GAIN,
    REFLEX_TICKS,
    SEEN,
    SEEN_NOISE,
    SEEN_TICKS,
    SENSED,
    SHOWN,
    TICKS,
    TREMOR,
    TREMOR_A,
    TREMOR_B,
    TREMOR_BEFORE,
    TREMOR_GAIN,
    UNSTEADY,
    VEERED,
    WISH_PERIOD,
    PersonState,
)

DRIFT_TIME = 120.0  # [s] in which the felt place of an unseen hand drifts: 15 to 120 s (Wann & Ibrahim 1992, m)
BLUR_TIME = 0.2  # [s] of what is seen: a fixation
CALIBRATION_TIME = 0.15  # [s] within which sight corrects what is felt
DOUBTED = 0.005  # [m], and three times the noise of what is felt: what is seen further away is not believed
VEER_TIME = 0.5  # [s] within which the felt direction of a movement wanders
ASTRAY_TIME = 0.5  # [s] within which a place that movement led astray is felt again where it is
UNSTEADY_TIME = 0.1  # [s] of noise of force: mostly below 2 Hz (Jones et al. 2002, m)


@njit
def sense(person: PersonState, p: Array, force: Array) -> None:
    """Note what is felt and seen, and make of what arrives now where the hand is believed to be."""
    n, m, V, past = person.numbers, person.memory, person.vectors, person.past
    _noise(person, DRIFT, n[FELT_NOISE], DRIFT_TIME)
    go_astray(person)
    _noise(person, BLUR, n[SEEN_NOISE], BLUR_TIME)
    _noise(person, UNSTEADY, n[FORCE_NOISE], UNSTEADY_TIME)
    if n[WISH_PERIOD] < 0.0:  # only an intent of the caller's own asks for the force
        _noise(person, MISFELT, n[FELT_FORCE_NOISE], UNSTEADY_TIME)
    size = past.shape[0]
    tick = int(m[TICKS])
    now = past[tick % size]
    felt, seen = past[(tick - int(n[REFLEX_TICKS])) % size], past[(tick - int(n[SEEN_TICKS])) % size]
    _look(person, p)
    kept = math.exp(-n[PERIOD] / CALIBRATION_TIME)
    for k in range(3):
        now[SENSED + k], now[SEEN + k] = V[HAND_P, k] + V[DRIFT, k] + V[ASTRAY, k], V[SHOWN, k] + V[BLUR, k]
        now[DEVIATION + k] = V[DRIVEN_P, k] - V[HAND_P, k]
        now[DEVIATING + k] = V[DRIVEN_V, k] - V[HAND_V, k]
        now[INTENT + k], now[PRESSED + k] = V[INTENDED, k], force[k]
        V[OFFSET, k] = kept * V[OFFSET, k] + (1.0 - kept) * (seen[SEEN + k] - seen[SENSED + k])
        V[BELIEF, k] = felt[SENSED + k] + V[OFFSET, k] + V[INTENDED, k] - felt[INTENT + k]
        V[FELT_FORCE, k] = (1.0 + V[MISFELT, k]) * felt[PRESSED + k]
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
def _noise(person: PersonState, which: int, deviation: float, seconds: float) -> None:
    """A step of a noise whose standard deviation and correlation time are given (an Ornstein–Uhlenbeck process)."""
    kept = math.exp(-person.numbers[PERIOD] / seconds)
    fresh = deviation * math.sqrt(1.0 - kept * kept)
    for k in range(3):
        person.vectors[which, k] = kept * person.vectors[which, k] + fresh * normal(person.chance)


@njit
def go_astray(person: PersonState) -> None:
    r"""A movement is felt to go in a direction that is wrong by a small rotation δ [rad], which wanders.

    .. math:: \dot e = \delta \times v - e / T

    for the error e of the place that is felt: unseen movements miss by an angle that is the same for short ways and
    long ones (Gordon, Ghilardi & Ghez 1994 I).
    """
    _noise(person, VEERED, person.numbers[DIRECTION_NOISE], VEER_TIME)
    V, v, angle = person.vectors, person.vectors[HAND_V], person.vectors[VEERED]
    period = person.numbers[PERIOD]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        V[ASTRAY, k] += period * (angle[i] * v[j] - angle[j] * v[i] - V[ASTRAY, k] / ASTRAY_TIME)


@njit
def _look(person: PersonState, p: Array) -> None:
    """Look at the figure, or at the stylus (p) where there is none."""
    m, V, eye = person.memory, person.vectors, person.eye
    if eye.pose.shape[0] == 0:
        V[SHOWN] = p
    elif int(m[TICKS]) % int(person.numbers[LOOK_TICKS]) == 0:
        felt, away = work_array(3), 0.0
        for k in range(3):
            felt[k] = V[HAND_P, k] + V[DRIFT, k] + V[ASTRAY, k]
        seen_place(eye, felt, work_array(eye.inverses.shape[2]), V[SHOWN])
        for k in range(3):
            away += (V[SHOWN, k] - felt[k]) ** 2
        if away > (DOUBTED + 3.0 * person.numbers[FELT_NOISE]) ** 2:  # she takes it for another pose
            V[SHOWN] = felt
