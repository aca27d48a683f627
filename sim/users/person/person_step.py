"""A person's time step: senses and decides once per servo tick, moves her arm at every physics step.

Her inputs are those of a real person: force and motion of the stylus with noise and reflex delay, vision with visual
delay, and her wishes. She has no access to field, phase or limiter.
"""

import numpy as np
from numba import njit, typeof, types

from controllers.lent import Lent
from geometry.arrays import Array
from sim.compilation.units import Unit
from sim.users.person import person_state as at
from sim.users.person.body import REFERENCE_GRIP
from sim.users.person.decisions import act_on_wish
from sim.users.person.muscles import move
from sim.users.person.person_state import PersonState, no_person
from sim.users.person.senses import sense


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
        Force of the last step [N], in H, shape (3,); set to that of this step.
    switch : Array
        Set to 1 while the switch is pressed, shape (1,).
    """
    if substep == 0:
        if person.memory[at.STARTED] == 0.0:
            _begin(person, p, v)
        sense(person, p, force)
        act_on_wish(person, switch)
    move(person, dt, p, v, force)


@njit
def _begin(person: PersonState, p: Array, v: Array) -> None:
    """Initialise the person with her hand at the stylus and moving with it, as her muscles drive it."""
    memory, vectors = person.memory, person.vectors
    vectors[:] = 0.0
    for place in (at.HAND_P, at.DRIVEN_P, at.BELIEF, at.SHOWN):
        vectors[place] = p
    vectors[at.HAND_V], vectors[at.DRIVEN_V] = v, v
    for row in range(person.past.shape[0]):
        person.past[row, at.SENSED : at.SENSED + 3] = p
        person.past[row, at.SEEN : at.SEEN + 3] = p
    memory[at.STARTED], memory[at.CAPACITY] = 1.0, 1.0
    memory[at.STIFFNESS_FACTOR] = 1.0 + person.numbers[at.STIFFENING] * (person.numbers[at.GRIP] - REFERENCE_GRIP)
    memory[at.DECIDED] = -person.numbers[at.REFRACTORY]


def person_unit() -> Unit:
    """The compilation unit of `person_step`, separate so that a change in it does not recompile the loop."""
    number, vector = types.float64, typeof(np.zeros(3))
    return Unit.of(person_step, Lent(typeof(no_person())), number, number, types.int64, vector, vector, vector, vector)


def link_person(person: PersonState) -> None:
    """Set the address of a person's compiled time step, in place; compiles it if it is not in the cache."""
    person.units[0] = person_unit().address()
