r"""Arming state machine of a device: disarmed → arming → ramping → active, and fault from every state.

The table `TRANSITIONS` defines the machine; an event without an entry changes nothing. After a fault there is no force
until the device is cleared and armed again, the demanded force has been small, and the force has been ramped in.
"""

from enum import IntEnum

import numpy as np
from numba import njit


class State(IntEnum):
    """State of a device; the motors are on only in `RAMPING` and `ACTIVE`."""

    DISARMED = 0
    ARMING = 1
    RAMPING = 2
    ACTIVE = 3
    FAULT = 4


class Event(IntEnum):
    """Event of the state machine.

    ARM, DISARM and CLEAR are requests of the user. QUIET: the demanded force has been small for long enough. RAMPED:
    the force is fully ramped in. RELEASED: the dead-man switch is not held. FAULTED: a fault is latched.
    """

    ARM = 0
    QUIET = 1
    RAMPED = 2
    RELEASED = 3
    DISARM = 4
    FAULTED = 5
    CLEAR = 6


TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.DISARMED, Event.ARM): State.ARMING,
    (State.ARMING, Event.QUIET): State.RAMPING,
    (State.RAMPING, Event.RAMPED): State.ACTIVE,
    (State.RAMPING, Event.RELEASED): State.ARMING,
    (State.ACTIVE, Event.RELEASED): State.ARMING,
    **{(state, Event.DISARM): State.DISARMED for state in (State.ARMING, State.RAMPING, State.ACTIVE)},
    **{(state, Event.FAULTED): State.FAULT for state in State},
    (State.FAULT, Event.CLEAR): State.DISARMED,
}
"""All transitions of the machine."""

_NEXT_STATE = np.array([[TRANSITIONS.get((state, event), state) for event in Event] for state in State], dtype=np.int64)

# Plain integers: numba freezes globals, but would look up a member of an enumeration in each kernel.
DISARMED, ARMING, RAMPING, ACTIVE, _ = (int(state) for state in State)
ARM, QUIET, RAMPED, RELEASED, DISARM, FAULTED, CLEAR = (int(event) for event in Event)
NO_REQUEST = -1


@njit
def next_state(state: int, event: int) -> int:
    """State after an event; unchanged where the table has no entry."""
    return _NEXT_STATE[state, event]


@njit
def motors_on(state: int) -> bool:
    """Whether the motors are on."""
    return state in (RAMPING, ACTIVE)
