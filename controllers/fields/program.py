"""The evaluation of a field: one compiled chain over its instructions, whatever it is composed of.

Every law has a kernel with the same arguments. `evaluate` calls them by name; `evaluate_units` by their address, so
that the servo compiles only the laws of its field (see `sim.compilation.kernel_units`).
"""

from collections.abc import Callable

import numpy as np
from numba import njit, types

from controllers.errors import ControllerError
from controllers.fields.algebra import blend, gate, limit
from controllers.fields.bunny import bunny_wrench
from controllers.fields.edited import recorded_wrench
from controllers.fields.follow import follow_wrench
from controllers.fields.governor import governor_wrench
from controllers.fields.higher_order import higher_order_wrench
from controllers.fields.instructions import (
    ADD,
    BLEND,
    BUNNY,
    EXTERNAL,
    FOLLOW,
    GATE,
    GOVERNOR,
    HIGHER_ORDER,
    LEADING,
    LIMIT,
    ORIENTATION,
    RECORDED,
    SOFT_WALL,
    STACK,
    STRETCHY,
    TRACE_DISTANCE,
    TRACE_ROW,
    Kernel,
    Program,
)
from controllers.fields.leading import leading_wrench
from controllers.fields.orientation import orientation_wrench
from controllers.fields.stretchy_tubes import stretchy_wrench
from controllers.kernel_call import kernel_call
from controllers.state import Array, IntArray

__all__ = ["LAW_ARGUMENTS", "LAW_KERNELS", "Program", "evaluate", "evaluate_units"]

LAW_KERNELS: dict[int, Kernel] = {
    FOLLOW: follow_wrench,
    BUNNY: bunny_wrench,
    HIGHER_ORDER: higher_order_wrench,
    RECORDED: recorded_wrench,
    STRETCHY: stretchy_wrench,
    LEADING: leading_wrench,
    GOVERNOR: governor_wrench,
    ORIENTATION: orientation_wrench,
}
"""Kernels of the laws by opcode."""

VECTOR = types.Array(types.float64, 1, "C")
"""Type of a row of numbers."""

LAW_ARGUMENTS = (VECTOR, types.int64, types.int64, VECTOR, types.int64, VECTOR, VECTOR)
"""Types of a kernel's arguments: params, at, curve, memory, slot, hand, wrench."""

_call = kernel_call(LAW_ARGUMENTS)
_NO_UNITS = np.zeros(0, dtype=np.int64)
_Law = Callable[[IntArray, int, Array, int, int, Array, int, Array, Array], None]
_Evaluation = Callable[[IntArray, IntArray, Array, Array, Array, Array], None]


@njit
def _law_by_name(
    units: IntArray,
    opcode: int,
    params: Array,
    at: int,
    curve: int,
    memory: Array,
    slot: int,
    hand: Array,
    wrench: Array,
) -> None:
    if opcode == FOLLOW:
        follow_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == BUNNY:
        bunny_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == HIGHER_ORDER:
        higher_order_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == RECORDED:
        recorded_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == STRETCHY:
        stretchy_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == LEADING:
        leading_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == GOVERNOR:
        governor_wrench(params, at, curve, memory, slot, hand, wrench)
    elif opcode == ORIENTATION:
        orientation_wrench(params, at, curve, memory, slot, hand, wrench)


@njit
def _law_by_address(
    units: IntArray,
    opcode: int,
    params: Array,
    at: int,
    curve: int,
    memory: Array,
    slot: int,
    hand: Array,
    wrench: Array,
) -> None:
    if units[opcode] == 0:
        raise ControllerError("the kernel of this law is not compiled; its opcode is missing in the units")
    _call(units[opcode], (params, at, curve, memory, slot, hand, wrench))


def _evaluation(law: _Law) -> _Evaluation:
    """Chain over the instructions of a field, which calls its laws by `law`."""

    @njit
    def run(units: IntArray, ops: IntArray, params: Array, memory: Array, hand: Array, wrench: Array) -> None:
        stack = np.empty((STACK, 6))
        top = 0
        memory[TRACE_DISTANCE] = np.inf
        for row in range(ops.shape[0]):
            opcode, at, slot, curve = ops[row, 0], ops[row, 1], ops[row, 2], ops[row, 3]
            before = memory[TRACE_DISTANCE]
            if opcode == ADD:
                top -= 1
                for i in range(6):
                    stack[top - 1, i] += stack[top, i]
            elif opcode == GATE:
                gate(params, at, hand, stack[top - 1])
            elif opcode == BLEND:
                top -= 1
                blend(params, at, hand, stack[top - 1], stack[top])
            elif opcode == LIMIT:
                limit(params, at, stack[top - 1])
            else:
                if opcode in (EXTERNAL, SOFT_WALL):
                    for i in range(6):
                        stack[top, i] = memory[slot + i]
                else:
                    law(units, opcode, params, at, curve, memory, slot, hand, stack[top])
                top += 1
            if memory[TRACE_DISTANCE] < before:
                memory[TRACE_ROW] = row
        for i in range(6):
            wrench[i] = stack[0, i]

    return run


_evaluate_names = _evaluation(_law_by_name)
evaluate_units = _evaluation(_law_by_address)
"""`evaluate` with one argument before its own: addresses of the laws' compiled kernels by opcode.

It raises a ControllerError if the address of a law that the field has is 0, which stands for not compiled.
"""


@njit
def evaluate(ops: IntArray, params: Array, memory: Array, hand: Array, wrench: Array) -> None:
    """Field's wrench at one tick.

    Parameters
    ----------
    ops, params
        Of a `Program`.
    memory : Array
        Its memory, written: state of the laws, and the trace in the first `TRACE_SIZE` numbers (see `instructions`).
    hand : Array, shape (15,)
        State of the hand (see `controllers.state`).
    wrench : Array, shape (6,)
        Written: [F_H (3) [N], τ_H (3) [N m]].
    """
    _evaluate_names(_NO_UNITS, ops, params, memory, hand, wrench)
