"""Instruction format of a compiled force field: rows of instructions over one array of parameters and one of memory.

A row is ``[code, parameters at, memory at, curve at]``. The code of a law is the index of its kernel in the program,
that of an operation a `Join`; the last number is the offset of a packed `Trajectory` in the parameters. Instructions
push wrenches on a stack (postfix notation), so that sums and blends of fields are instructions too.

The first `TRACE_SIZE` numbers of the memory are the trace of the last evaluation, which is recorded: ``[t*, c (3), d,
row, attractor, river]``: phase, point and distance of the nearest curve, the row of its law, the phase of the
attracting point (t* itself, or the bunny's), and the number of the active river of a higher-order field (−1 for none,
or without such a field). With no curve near, d is infinite.
"""

from collections.abc import Callable
from enum import IntEnum

import numpy as np
from numba import njit, types

from controllers.curves.trajectory import curve_point
from geometry.arrays import Array


class Join(IntEnum):
    """Operations on the wrenches on the stack; a law is a row with a code of 0 or more."""

    ADD = -1
    GATE = -2
    BLEND = -3
    LIMIT = -4

    @property
    def takes(self) -> int:
        """Number of wrenches that the operation pops from the stack; it pushes one."""
        return 2 if self in (Join.ADD, Join.BLEND) else 1


OP_CODE, OP_PARAMETERS, OP_MEMORY, OP_CURVE = range(4)
"""Columns of a row of instructions."""
STACK = 16  # depth of the stack: largest number of pending wrenches

TRACE_PHASE, TRACE_POINT, TRACE_DISTANCE, TRACE_ROW, TRACE_ATTRACTOR, TRACE_RIVER, TRACE_SIZE = 0, 1, 4, 5, 6, 7, 8

Kernel = Callable[[Array, int, int, Array, int, Array, Array], None]
"""Compiled law ``kernel(params, at, curve, memory, slot, hand, wrench)``.

It reads its parameters from ``params[at:]``, its curve from ``params[curve:]`` and the hand vector of
`controllers.state`; it writes force [N] and moment [N m] in H into `wrench` (6,), and what it keeps until the next tick
into ``memory[slot:]``. All laws of a field share the two arrays. A law that leads along a curve writes the trace too
(`write_trace`)."""

VECTOR = types.Array(types.float64, 1, "C")
"""Type of a row of numbers."""
LAW_ARGUMENTS = (VECTOR, types.int64, types.int64, VECTOR, types.int64, VECTOR, VECTOR)
"""Types of a kernel's arguments: params, at, curve, memory, slot, hand, wrench."""


def empty_trace() -> Array:
    """Trace of a field that has not been evaluated yet."""
    trace = np.zeros(TRACE_SIZE)
    trace[TRACE_DISTANCE], trace[TRACE_RIVER] = np.inf, -1.0
    return trace


@njit
def write_trace(params: Array, curve: int, memory: Array, phase: float, distance: float, attractor: float) -> None:
    """Write the closest point of a curve to the trace, unless the trace has a nearer one."""
    if distance < memory[TRACE_DISTANCE]:
        write_trace_point(memory, phase, curve_point(params, curve, phase), distance, attractor)


@njit
def write_trace_point(
    memory: Array, phase: float, place: tuple[float, float, float], distance: float, attractor: float
) -> None:
    """Write the nearest point of a law [m] to the trace, unless the trace has a nearer one."""
    if distance < memory[TRACE_DISTANCE]:
        memory[TRACE_PHASE], memory[TRACE_DISTANCE], memory[TRACE_ATTRACTOR] = phase, distance, attractor
        memory[TRACE_POINT], memory[TRACE_POINT + 1], memory[TRACE_POINT + 2] = place
