"""Interval arithmetic over CasADi functions: bounds of an expression on many boxes at once, rounded outwards."""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from controllers.certificates.report import CertificateError
from geometry.arrays import Array


class Interval(NamedTuple):
    """Intervals [low, high], one for each of n boxes, shapes (n,)."""

    low: Array
    high: Array


def _round_outwards(low: Array, high: Array) -> Interval:
    """Interval widened by two units in the last place, more than the rounding error of any operation here."""
    return Interval(low - 4e-16 * np.abs(low) - 1e-300, high + 4e-16 * np.abs(high) + 1e-300)


def _add(a: Interval, b: Interval) -> Interval:
    return _round_outwards(a.low + b.low, a.high + b.high)


def _subtract(a: Interval, b: Interval) -> Interval:
    return _round_outwards(a.low - b.high, a.high - b.low)


def _multiply(a: Interval, b: Interval) -> Interval:
    ends = (a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high)
    return _round_outwards(np.minimum.reduce(ends), np.maximum.reduce(ends))


def _divide(a: Interval, b: Interval) -> Interval:
    if np.any((b.low <= 0.0) & (b.high >= 0.0)):
        raise CertificateError("an interval is divided by one that holds zero: the boxes are too large")
    return _multiply(a, _round_outwards(1.0 / b.high, 1.0 / b.low))


def _square(a: Interval) -> Interval:
    ends = (a.low * a.low, a.high * a.high)
    holds_zero = (a.low <= 0.0) & (a.high >= 0.0)
    return _round_outwards(np.where(holds_zero, 0.0, np.minimum(*ends)), np.maximum(*ends))


def _square_root(a: Interval) -> Interval:
    if np.any(a.low < 0.0):
        raise CertificateError("the root of an interval below zero: the boxes are too large")
    return _round_outwards(np.sqrt(a.low), np.sqrt(a.high))


def _cosine(a: Interval) -> Interval:
    """Values at the ends, and ±1 where an interval contains a multiple of π."""
    first, second = np.cos(a.low), np.cos(a.high)
    low, high = np.minimum(first, second), np.maximum(first, second)
    turns = np.ceil(a.low / np.pi - 1e-12)
    inside = turns * np.pi <= a.high + 1e-12
    even = np.mod(turns, 2.0) == 0.0
    both = (turns + 1.0) * np.pi <= a.high + 1e-12
    high = np.where(inside & (even | both), 1.0, high)
    low = np.where(inside & (~even | both), -1.0, low)
    return _round_outwards(low - 1e-15, high + 1e-15)


def _sine(a: Interval) -> Interval:
    return _cosine(_round_outwards(a.low - 0.5 * np.pi, a.high - 0.5 * np.pi))


_UNARY: dict[int, Callable[[Interval], Interval]] = {
    ca.OP_SIN: _sine, ca.OP_COS: _cosine, ca.OP_SQ: _square, ca.OP_SQRT: _square_root,
    ca.OP_NEG: lambda a: Interval(-a.high, -a.low), ca.OP_TWICE: lambda a: _add(a, a), ca.OP_ASSIGN: lambda a: a,
}  # fmt: skip
_BINARY: dict[int, Callable[[Interval, Interval], Interval]] = {
    ca.OP_ADD: _add, ca.OP_SUB: _subtract, ca.OP_MUL: _multiply, ca.OP_DIV: _divide,
}  # fmt: skip


def bounds(function: Any, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds of the values of a function on boxes.

    Parameters
    ----------
    function : casadi.Function
        Function of one vector of m numbers, with one dense result of r rows and c columns.
    low, high : Array, shape (n, m)
        Corners of the boxes.

    Returns
    -------
    low, high : Array, shape (n, r, c)
        Every value lies within these; how tight they are depends on how the expression is written.

    Raises
    ------
    CertificateError
        If the function uses an operation other than + − × ÷, squares, roots, sine and cosine, divides by an interval
        that contains zero, or takes the root of one that contains negative numbers.
    """
    work: dict[int, Interval] = {}
    n, shape = len(low), function.size_out(0)
    result = np.zeros((2, n, shape[0] * shape[1]))
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_INPUT:
            work[outputs[0]] = Interval(low[:, inputs[1]], high[:, inputs[1]])
        elif operation == ca.OP_CONST:
            value = np.full(n, function.instruction_constant(k))
            work[outputs[0]] = Interval(value, value)
        elif operation == ca.OP_OUTPUT:
            result[0, :, outputs[1]], result[1, :, outputs[1]] = work[inputs[0]]
        elif operation in _UNARY:
            work[outputs[0]] = _UNARY[operation](work[inputs[0]])
        elif operation in _BINARY:
            work[outputs[0]] = _BINARY[operation](work[inputs[0]], work[inputs[1]])
        elif operation == ca.OP_INV:
            one = np.ones(n)
            work[outputs[0]] = _divide(Interval(one, one), work[inputs[0]])
        else:
            raise CertificateError(f"no interval arithmetic for operation {operation} of CasADi")
    # CasADi stores matrices column by column.
    lower, upper = (part.reshape(n, shape[1], shape[0]).transpose(0, 2, 1) for part in result)
    return lower, upper


def spectral_bound(low: Array, high: Array) -> Array:
    """Upper bound on the largest singular value of a matrix between two entrywise bounds, shape (n, r, c) → (n,)."""
    middle, radius = 0.5 * (low + high), 0.5 * (high - low)
    return np.linalg.norm(middle, ord=2, axis=(1, 2)) + np.linalg.norm(radius, axis=(1, 2))
