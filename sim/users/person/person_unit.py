"""The compilation unit of a person's time step, separate so that a change in it does not recompile the loop."""

import numpy as np
from numba import typeof, types

from controllers.lent import Lent
from sim.compilation.units import Unit
from sim.users.person.person_state import PersonState, nobody
from sim.users.person.person_step import person_step


def person_unit() -> Unit:
    """The compilation unit of `person_step`."""
    number, vector = types.float64, typeof(np.zeros(3))
    return Unit.of(person_step, Lent(typeof(nobody())), number, number, types.int64, vector, vector, vector, vector)


def link_person(person: PersonState) -> None:
    """Set the address of a person's compiled time step, in place; compiles it if it is not in the cache."""
    person.units[0] = person_unit().address()
