"""State of a simulated person in compiled code: parameters, matrices, memory, delay lines and random state."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array, IntArray
from sim.users.person.eye import Eye, no_eye
from sim.users.person.wishes import WISH_SIZE

(GRIP, STIFFENING, GRIP_STIFFNESS, GRIP_DAMPING, STRENGTH, FATIGUE, REFLEX_GAIN, SKILL, FELT_NOISE, FELT_FORCE_NOISE,
 DIRECTION_NOISE, SEEN_NOISE, REFRACTORY, HORIZON, MOTOR_NOISE, FORCE_NOISE, TREMOR_GAIN, TREMOR_A, TREMOR_B,
 CORRECTION, CAUTION, ENTRAINMENT, LEARNING, PERIOD, WISH_PERIOD, LAP, REFLEX_TICKS, SEEN_TICKS, LOOK_TICKS,
 N_NUMBERS) = range(30)  # fmt: skip
"""Indices in `PersonState.numbers`: parameters of the person (for the tremor, of its filter), of her wishes, and delays
in ticks."""

(STARTED, TICKS, CLOCK, BEGUN, LASTS, DECIDED, CAPACITY, TARGET, ENGAGED_SHARE, STIFFNESS_FACTOR, CALM,
 N_MEMORY) = range(12)  # fmt: skip
"""Indices in `PersonState.memory`: 1 once she has begun, ticks so far, her own clock [s], start and duration of the
current submovement [s], time of the last decision [s], share of strength left after fatigue, number of the current
target, degree of muscle activation, impedance relative to that at the reference grip, and the last time at which the
hand was where the submovement had it [s]."""

(HAND_P, HAND_V, DRIVEN_P, DRIVEN_V, DRIVEN_A, INTENDED, OFFSET, DRIFT, BLUR, BELIEF, WANTED_FORCE, REFLEX, UNSTEADY,
 TREMOR, TREMOR_BEFORE, FELT_FORCE, FELT_FORCE_ERROR, SHOWN, DIRECTION_ERROR, DIRECTION_ERROR_OFFSET,
 N_VECTORS) = range(21)  # fmt: skip
"""Rows of `PersonState.vectors`, in H: the hand's position and velocity; the motion that the muscles drive it to
(position, velocity, acceleration); the displacement intended so far; the correction of the felt position by vision;
noise of the felt and of the seen position; her estimate of her hand's position; the force that she wants; the reflex
force; relative noise of force; tremor now and one tick ago; the felt force and its relative noise; the position that is
shown; the error of felt direction [rad], and the error of the felt position that results from it."""

SENSED, DEVIATION, DEVIATING, SEEN, INTENT, PRESSED, PAST_SIZE = 0, 3, 6, 9, 12, 15, 18
"""Columns of `PersonState.past`, (3) each: felt position, deviation of the hand from the driven position and its rate,
seen position, intended displacement, force on the stylus."""

LEARNED_PARTS = 48
"""Number of parts of a lap for each of which a force is learned."""


class PersonState(NamedTuple):
    """State of a person in the loop; if the first address is 0, there is no person.

    Attributes
    ----------
    units : IntArray
        Address of `sim.users.person.person_step.person_step`, and of a compiled user-defined intent; 0 for none.
    numbers, memory, vectors : Array
        See above, shapes (`N_NUMBERS`,), (`N_MEMORY`,), (`N_VECTORS`, 3).
    inertia, mobility, stiffness, damping : Array
        M, M⁻¹, K, B of the arm, shape (3, 3).
    wishes : Array
        See `sim.users.person.wishes`, shape (n, 10).
    past : Array
        Delay line of what was felt and seen, a ring of rows by tick.
    plans : Array
        Coefficients of the submovement as it is driven, and as she believes it, shape (2, 6, 3).
    learned : Array
        Learned forces [N] by part of a lap, shape (`LEARNED_PARTS`, 3).
    rng : Array of uint64
        State of her random numbers.
    eye : Eye
        What she has learned of the figure, by which she interprets a pose.
    """

    units: IntArray
    numbers: Array
    memory: Array
    vectors: Array
    inertia: Array
    mobility: Array
    stiffness: Array
    damping: Array
    wishes: Array
    past: Array
    plans: Array
    learned: Array
    rng: npt.NDArray[np.uint64]
    eye: Eye


def no_person() -> PersonState:
    """The empty state that the loop holds where there is no person."""
    none, square = np.zeros(0), np.zeros((0, 3))
    return PersonState(
        np.zeros(2, dtype=np.int64), none, none.copy(), square, square, square, square, square,
        np.zeros((0, WISH_SIZE)), np.zeros((0, PAST_SIZE)), np.zeros((0, 6, 3)), square,
        np.zeros(0, dtype=np.uint64), no_eye(),
    )  # fmt: skip
