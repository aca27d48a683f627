"""An intent of the caller's own: a function that says what a person wants, from what she knows.

Her wishes are then two rows (see `sim.users.wishes`) that the function writes: the wish now, and in the place of the
second row the velocity at which the wanted place moves.
"""

from numba import types

from controllers.kernel_call import kernel_call

_VECTOR = types.Array(types.float64, 1, "C")
INTENT_ARGUMENTS = (types.float64, _VECTOR, _VECTOR, types.Array(types.float64, 2, "C"))
call_intent = kernel_call(INTENT_ARGUMENTS)
"""Call of a compiled intent: ``(t, place, force, rows)``, from compiled code."""
