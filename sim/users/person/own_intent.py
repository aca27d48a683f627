"""The calling convention of a compiled user-defined intent (see `sim.users.intents.own`).

The wishes are then two rows (see `sim.users.person.wishes`) that the function writes: the wish now, and in the place
columns of the second row the velocity of the wanted place.
"""

from numba import types

from controllers.kernel_call import kernel_call

_VECTOR = types.Array(types.float64, 1, "C")
INTENT_ARGUMENTS = (types.float64, _VECTOR, _VECTOR, types.Array(types.float64, 2, "C"))
call_intent = kernel_call(INTENT_ARGUMENTS)
"""Calls a compiled intent with ``(t, place, force, rows)``, from compiled code."""
