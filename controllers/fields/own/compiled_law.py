"""User-defined force laws compiled by numba: as cheap to evaluate as the built-in ones."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import njit, types
from numba.cpython.unsafe.tuple import tuple_setitem

from controllers.errors import ControllerError, ParameterError
from controllers.fields.algebra.instructions import Kernel
from controllers.fields.algebra.law import Program
from controllers.fields.own.function_law import FunctionLaw, place_of
from controllers.state import HandState, Wrench, hand_state
from geometry.arrays import Array

_NUMBER = types.float64
_HAND = types.NamedTuple(
    [
        _NUMBER,
        types.UniTuple(_NUMBER, 3),
        types.UniTuple(_NUMBER, 4),
        types.UniTuple(_NUMBER, 3),
        types.UniTuple(_NUMBER, 3),
        types.boolean,
    ],
    HandState,
)


@dataclass(frozen=True, eq=False, repr=False)
class CompiledLaw(FunctionLaw):
    """Field computed by a function that numba compiles when the law is made.

    The function gets numbers only: vectors of the hand are tuples, and it returns a tuple. A division by zero gives
    inf or NaN, as in NumPy, and raises nothing. Parameters are those of `FunctionLaw`.

    Raises
    ------
    ParameterError
        If the function cannot be compiled, or does not return a tuple of three or six numbers.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        _kernel(self.function, len(self.parameters))

    def wrench(self, hand: HandState) -> Wrench:
        """Force and moment at one hand state.

        Raises
        ------
        ParameterError
            If they are not finite, or the function raises: compiled code does not name the source of an error.
        """
        try:
            return super().wrench(hand)
        except ControllerError:
            raise
        except Exception as error:
            raise ParameterError(
                f"{self.place} raised {type(error).__name__}: {error}; for a hand at p = {np.round(hand.p, 4).tolist()}"
            ) from error

    def _compose(self) -> Program:
        numbers = [float(value) for value in self.parameters.values()]
        return Program.of(self, _kernel(self.function, len(numbers)), numbers, [])


@cache
def _kernel(function: Callable[..., Any], count: int) -> Kernel:
    """The function as a law's kernel; its parameters are `count` numbers, in the order of its arguments."""
    signature = (_HAND, *[_NUMBER] * count)
    try:
        compiled: Any = njit(error_model="numpy")(function)
        compiled.compile(signature)
    except Exception as error:  # NumbaError, TypeError of an object that is no function, what used modules raise
        at = re.findall(r'File "[^"]*", line (\d+)', str(error))
        where = f"in line {at[-1]}: " if at else ""
        raise ParameterError(
            f"{place_of(function)} cannot be compiled: {where}{_reason(str(error))}. Expected a function of numbers, "
            "see docs/tutorials/your-own-law.md"
        ) from None
    return_type: Any = compiled.overloads[signature].signature.return_type
    is_tuple = isinstance(return_type, types.BaseTuple)
    if not is_tuple or len(return_type) not in (3, 6) or not all(_is_number(kind) for kind in return_type):  # pyright: ignore[reportGeneralTypeIssues]
        raise ParameterError(
            f"{place_of(function)} returns {return_type}; expected a tuple of three numbers, the force [N], or of six, "
            "with the moment [N m]"
        )
    if len(return_type) == 6 and _count_in_python(function) == 3:  # pyright: ignore[reportUnknownArgumentType]
        raise ParameterError(
            f"{place_of(function)} gives six numbers compiled and three in Python: vectors of a hand are tuples in a "
            "compiled law, which + joins; expected sums of their components"
        )
    write, numbers_of = _write_force if len(return_type) == 3 else _write_wrench, _make_reader(count)

    @njit
    def own_law(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
        write(wrench, compiled(hand_state(hand), *numbers_of(params, at)))

    return own_law


def _count_in_python(function: Callable[..., Any]) -> int | None:
    """How many numbers a function returns for a hand whose vectors are arrays; None if it raises."""
    try:
        return int(np.size(function(HandState.at(np.full(3, 0.01), np.full(3, 0.01), 0.0))))
    except Exception:  # whatever fails outside compiled code
        return None


def _reason(message: str) -> str:
    """Numba's message about a function, in one line."""
    lines = [line.strip() for line in message.splitlines()]
    first = next((line for line in lines if line and not line.startswith("Failed in")), "no reason given")
    if field := re.match(r"Unknown attribute '(\w+)' of type HandState", first):
        return f"a hand has no {field[1]}; it has {', '.join(HandState._fields)}"
    calls = [line.removeprefix(">>> ") for line in lines if line.startswith(">>> ")]
    if first.startswith("No implementation of function") and calls:  # the call is some lines below
        return f"there is no {calls[0]} for arguments of these types"
    return first.rstrip(".:")


def _is_number(kind: Any) -> bool:
    return isinstance(types.unliteral(kind), types.Float | types.Integer | types.Boolean)


def _make_reader(count: int) -> Callable[[Array, int], tuple[float, ...]]:
    """Compiled function that reads `count` consecutive numbers of an array as a tuple."""
    if count == 0:

        @njit
        def none(params: Array, at: int) -> tuple[float, ...]:
            return ()

        return none
    zeros = (0.0,) * count

    @njit
    def read(params: Array, at: int) -> tuple[float, ...]:
        numbers = zeros
        for i in range(count):
            numbers = tuple_setitem(numbers, i, params[at + i])  # pyright: ignore[reportCallIssue]
        return numbers

    return read


@njit
def _write_force(wrench: Array, force: tuple[float, float, float]) -> None:
    wrench[0], wrench[1], wrench[2] = force
    wrench[3:] = 0.0


@njit
def _write_wrench(wrench: Array, given: tuple[float, ...]) -> None:
    wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5] = given
