"""The unit of compiled code that a person is: kept by itself, so a change in people compiles no loop again."""

import numpy as np
from numba import typeof, types

from sim.compilation.units import Unit
from sim.users.person_state import PersonState, nobody
from sim.users.person_step import person_step


def person_unit() -> Unit:
    """Unit of a person's time step."""
    number, vector = types.float64, typeof(np.zeros(3))
    return Unit.of(person_step, typeof(nobody()), number, number, types.int64, vector, vector, vector, vector)


def link_person(person: PersonState) -> None:
    """Give a person the address of her code, in place; compiles it if it is not kept."""
    person.units[0] = person_unit().address()
