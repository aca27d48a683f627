"""A person as compiled code holds her: numbers, matrices, what she remembers, and her random numbers."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.state import Array
from sim.users.eye import Eye, no_eye
from sim.users.wishes import WISH_SIZE

IntArray = npt.NDArray[np.int64]

(GRIP, STIFFENING, GRIP_STIFFNESS, GRIP_DAMPING, STRENGTH, FATIGUE, REFLEX_GAIN, SKILL, FELT_NOISE, FELT_FORCE_NOISE,
 DIRECTION_NOISE, SEEN_NOISE, REFRACTORY, HORIZON, MOTOR_NOISE, FORCE_NOISE, TREMOR_GAIN, TREMOR_A, TREMOR_B,
 CORRECTION, CAUTION, ENTRAINMENT, LEARNING, PERIOD, WISH_PERIOD, LAP, REFLEX_TICKS, SEEN_TICKS, LOOK_TICKS,
 N_NUMBERS) = range(30)  # fmt: skip
"""Numbers of a person, of her wishes, and her delays in ticks; the tremor's are of its filter."""

(STARTED, TICKS, CLOCK, BEGUN, LASTS, DECIDED, CAPACITY, TARGET, ENGAGED_SHARE, STIFFER, CALM,
 N_MEMORY) = range(12)  # fmt: skip
"""What she remembers: whether she has begun, ticks so far, her own clock [s], when her submovement began and how long
it lasts [s], when she last decided [s], share of her strength that is left, the target whose turn it is, how far she is
engaged, impedance over that of the reference grip, and until
when the hand was where it should be [s]."""

(HAND_P, HAND_V, DRIVEN_P, DRIVEN_V, DRIVEN_A, INTENDED, OFFSET, DRIFT, BLUR, BELIEF, WANTED_FORCE, REFLEX, UNSTEADY,
 TREMOR, TREMOR_BEFORE, FELT_FORCE, MISFELT, SHOWN, VEERED, ASTRAY, N_VECTORS) = range(21)  # fmt: skip
"""Vectors in H: the hand's position and velocity; what the muscles drive it to (position, velocity, acceleration); the
way that was intended so far; what sight adds to what is felt; noise of what is felt and seen; where she believes her
hand is; the force that she wants; the reflexes'; noise of force; tremor now and a tick ago; the force that she
feels, and the noise of that over the force; the place that is shown; by what angle her hand is felt to go in a wrong
direction [rad], and how far that has led the felt place astray."""

SENSED, DEVIATION, DEVIATING, SEEN, INTENT, PRESSED, PAST_SIZE = 0, 3, 6, 9, 12, 15, 18
"""Columns of what was: place that is felt, deviation from where she is driven and its rate, place that is seen, way
intended, force on the stylus; (3) each."""

LEARNED_PARTS = 48
"""Parts of a lap for which a force is learned."""


class PersonState(NamedTuple):
    """A person as the loop holds her; without an address there is nobody.

    Attributes
    ----------
    units : IntArray
        Address of `sim.users.person_step.person_step`, and of a kernel of the caller's own intent; 0 for none.
    numbers, memory, vectors : Array
        See above, shapes (`N_NUMBERS`,), (`N_MEMORY`,), (`N_VECTORS`, 3).
    inertia, mobility, stiffness, damping : Array
        Of the arm, M, M⁻¹, K, B, shape (3, 3).
    wishes : Array
        See `sim.users.wishes`, shape (n, 10).
    past : Array
        What was felt and seen, a ring of rows by tick.
    plans : Array
        Submovement as it is driven, and as she believes it, shape (2, 6, 3).
    learned : Array
        Forces [N] by part of a lap, shape (`LEARNED_PARTS`, 3).
    chance : Array of uint64
        Of her random numbers.
    eye : Eye
        What she compares the figure with.
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
    chance: npt.NDArray[np.uint64]
    eye: Eye


def nobody() -> PersonState:
    """Nobody: what the loop holds in the place of a person."""
    none, square = np.zeros(0), np.zeros((0, 3))
    return PersonState(
        np.zeros(2, dtype=np.int64), none, none.copy(), square, square, square, square, square,
        np.zeros((0, WISH_SIZE)), np.zeros((0, PAST_SIZE)), np.zeros((0, 6, 3)), square,
        np.zeros(0, dtype=np.uint64), no_eye(),
    )  # fmt: skip
