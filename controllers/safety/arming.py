r"""When a device may push: disarmed → arming → ramping → active, and fault from everywhere.

A machine is its table: what is not in it changes nothing. There is no way from a fault to a force but by being cleared,
armed again, quiet, and ramped in.
"""

from enum import IntEnum

import numpy as np
from numba import njit


class State(IntEnum):
    """Of a device: only a `RAMPING` or `ACTIVE` one has its motors on."""

    DISARMED = 0
    ARMING = 1
    RAMPING = 2
    ACTIVE = 3
    FAULT = 4


class Event(IntEnum):
    """What may happen to a state.

    ARM, DISARM and CLEAR are the user's. QUIET: the force that is asked for has been small for long enough. RELEASED:
    the dead-man switch is not held. FAULTED: a fault is latched.
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
"""All that can happen."""

_NEXT = np.array([[TRANSITIONS.get((state, event), state) for event in Event] for state in State], dtype=np.int64)

# numba freezes globals; a member of an enumeration would be looked up in each kernel.
DISARMED, ARMING, RAMPING, ACTIVE, FAULT = (int(state) for state in State)
ARM, QUIET, RAMPED, RELEASED, DISARM, FAULTED, CLEAR = (int(event) for event in Event)
NO_REQUEST = -1


@njit
def next_state(state: int, event: int) -> int:
    """State after an event; the same where the table has none."""
    return _NEXT[state, event]


@njit
def pushes(state: int) -> bool:
    """Whether the motors are on."""
    return state in (RAMPING, ACTIVE)


def mermaid() -> str:
    """The table as a state diagram, for the documents."""
    lines = [
        f"    {a.name.lower()} --> {b.name.lower()}: {event.name.lower()}" for (a, event), b in TRANSITIONS.items()
    ]
    return "\n".join(["stateDiagram-v2", "    [*] --> disarmed", *lines])
