"""The evaluation of a field: one compiled chain over its instructions, whatever it is composed of."""

import numpy as np
from numba import njit

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
    Program,
)
from controllers.fields.leading import leading_wrench
from controllers.fields.orientation import orientation_wrench
from controllers.fields.stretchy_tubes import stretchy_wrench
from controllers.state import Array, IntArray

__all__ = ["Program", "evaluate"]


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
    stack = np.empty((STACK, 6))
    top = 0
    memory[TRACE_DISTANCE] = np.inf
    for row in range(ops.shape[0]):
        opcode, at, slot, curve = ops[row, 0], ops[row, 1], ops[row, 2], ops[row, 3]
        before = memory[TRACE_DISTANCE]
        if opcode == FOLLOW:
            follow_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == BUNNY:
            bunny_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == HIGHER_ORDER:
            higher_order_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == RECORDED:
            recorded_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == STRETCHY:
            stretchy_wrench(params, at, memory, slot, hand, stack[top])
            top += 1
        elif opcode == LEADING:
            leading_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == GOVERNOR:
            governor_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode == ORIENTATION:
            orientation_wrench(params, at, curve, memory, slot, hand, stack[top])
            top += 1
        elif opcode in (EXTERNAL, SOFT_WALL):
            for i in range(6):
                stack[top, i] = memory[slot + i]
            top += 1
        elif opcode == ADD:
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
        if memory[TRACE_DISTANCE] < before:
            memory[TRACE_ROW] = row
    for i in range(6):
        wrench[i] = stack[0, i]
