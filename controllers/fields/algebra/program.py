"""Evaluation of a field: one compiled interpreter of its instructions, the same for every composition.

Every law has a kernel with the same signature, called by its address. So only kernels that are used are compiled, and
a user-defined law is called like a built-in one.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from controllers.errors import ControllerError
from controllers.fields.algebra.instructions import (
    LAW_ARGUMENTS,
    OP_CODE,
    OP_CURVE,
    OP_MEMORY,
    OP_PARAMETERS,
    STACK,
    TRACE_DISTANCE,
    TRACE_ROW,
    Join,
)
from controllers.fields.algebra.weights import blend, gate, limit
from controllers.kernel_call import kernel_call
from controllers.work_array import work_array
from geometry.arrays import Array, IntArray

_call = kernel_call(LAW_ARGUMENTS)


class Compiled(NamedTuple):
    """First arguments of `evaluate`: ``evaluate(*program.compiled(), memory, hand, wrench)``.

    Attributes
    ----------
    units : IntArray, shape (kernels,)
        Addresses of the compiled kernels of the laws, 0 for one that is not compiled.
    ops : IntArray, shape (n, 4)
        Instructions.
    params : Array
        Gains and packed curves.
    """

    units: IntArray
    ops: IntArray
    params: Array


@njit
def evaluate(units: IntArray, ops: IntArray, params: Array, memory: Array, hand: Array, wrench: Array) -> None:
    """Wrench of a field at one tick.

    Parameters
    ----------
    units, ops, params
        See `Compiled`.
    memory : Array
        Memory of the program, written: the trace in the first `TRACE_SIZE` numbers (see `instructions`), then the
        state of the laws.
    hand : Array, shape (15,)
        State of the hand (see `controllers.state`).
    wrench : Array, shape (6,)
        Written: [F_H (3) [N], τ_H (3) [N m]].

    Raises
    ------
    ControllerError
        If the address of a kernel is 0.
    """
    stack = work_array((STACK, 6))
    top = 0
    memory[TRACE_DISTANCE] = np.inf
    for row in range(ops.shape[0]):
        code, at, slot, curve = ops[row, OP_CODE], ops[row, OP_PARAMETERS], ops[row, OP_MEMORY], ops[row, OP_CURVE]
        if code == Join.ADD:
            top -= 1
            for i in range(6):
                stack[top - 1, i] += stack[top, i]
        elif code == Join.GATE:
            gate(params, at, hand, stack[top - 1])
        elif code == Join.BLEND:
            top -= 1
            blend(params, at, hand, stack[top - 1], stack[top])
        elif code == Join.LIMIT:
            limit(params, at, stack[top - 1])
        else:
            address = int(units[code])
            if address == 0:
                raise ControllerError("the kernel of a law of this field is not compiled; its address is 0")
            before = memory[TRACE_DISTANCE]
            _call(address, (params, at, curve, memory, slot, hand, stack[top]))
            top += 1
            if memory[TRACE_DISTANCE] < before:
                memory[TRACE_ROW] = row
    for i in range(6):
        wrench[i] = stack[0, i]
