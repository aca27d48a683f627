"""Symbolic execution of a user-defined law: numbers of the hand as CasADi symbols whose comparisons are decided.

A Python function that compares numbers of the hand takes one of several paths. Every comparison asks an `ExecutionPath`
for its truth; the path answers with the decisions that it was given, and records what was decided. All paths together,
with their conditions, are the function (King, *Symbolic execution and program testing*, CACM 19(7), 1976).
"""

from collections.abc import Callable, Sequence
from functools import partialmethod
from numbers import Real
from typing import Any, ClassVar, Literal, NamedTuple, NoReturn

import casadi
import numpy as np

from controllers.certificates.loop.device import Symbol
from controllers.errors import ControllerError

_MAX_DEPTH = 1000  # depth to which nested operations are compared; deeper expressions count as different
MAX_CONDITIONS = 64  # decisions on one path: more indicate a loop that does not end on symbols


class NotExecutable(ControllerError):
    """A function that cannot be executed on symbols."""


class Condition(NamedTuple):
    """One decided comparison.

    Attributes
    ----------
    gap : Symbol
        Left side minus right side.
    kind : {"<", "<=", "=="}
        Comparison of the gap with zero.
    holds : bool
        The decision: whether the comparison holds.
    """

    gap: Symbol
    kind: Literal["<", "<=", "=="]
    holds: bool

    def symbol(self) -> Symbol:
        """1 where the gap satisfies the decision, 0 elsewhere (also for NaN, if the comparison was decided to hold)."""
        true = {"<": self.gap < 0.0, "<=": self.gap <= 0.0, "==": self.gap == 0.0}[self.kind]
        return true if self.holds else casadi.logic_not(true)


def identical(a: Symbol, b: Symbol) -> bool:
    """Whether two expressions are the same, to the last bit of their numbers (their texts show six digits only)."""
    return bool(casadi.is_equal(a, b, _MAX_DEPTH))


_TRUE_SIGNS = {"<": frozenset((-1,)), "<=": frozenset((-1, 0)), "==": frozenset((0,))}


class ExecutionPath:
    """One path through a function: the first decisions are given, and every further comparison is taken to hold.

    A comparison whose result follows from earlier ones of the same two numbers is not decided again.
    """

    def __init__(self, given: Sequence[bool]) -> None:
        self.given = tuple(given)
        self.conditions: list[Condition] = []
        self.lost: str | None = None
        self._possible_signs = list[tuple[Symbol, frozenset[int]]]()  # signs that a gap may still have, the latest last

    def decide(self, left: Any, right: Any, kind: Literal["<", "<=", "=="]) -> bool:
        """Truth of ``left kind right`` on this path."""
        gap, true = casadi.SX(left - right), _TRUE_SIGNS[kind]
        if gap.is_constant():
            return (float(gap) > 0.0) - (float(gap) < 0.0) in true and float(gap) == float(gap)
        signs = next(
            (left for known_gap, left in reversed(self._possible_signs) if identical(known_gap, gap)),
            frozenset((-1, 0, 1)),
        )
        if signs <= true or not signs & true:
            return signs <= true
        at = len(self.conditions)
        if at >= MAX_CONDITIONS:
            self.lose(f"it compares numbers of the hand more than {MAX_CONDITIONS} times")
        holds = self.given[at] if at < len(self.given) else True
        remaining = signs & true if holds else signs - true
        self._possible_signs += ((gap, remaining), (casadi.SX(right - left), frozenset(-sign for sign in remaining)))
        self.conditions.append(Condition(gap, kind, holds))
        return holds

    def lose(self, why: str) -> NoReturn:
        """Give up on the function. The reason is stored, since the function may catch the exception."""
        self.lost = self.lost or why
        raise NotExecutable(why)


_CONVERSION_MESSAGE = (
    "it converts a number of the hand to a plain one, as float(), the functions of math and an array of floats do; "
    "expected functions of NumPy, as np.sqrt, np.hypot, np.linalg.norm(hand.p), and np.array([...]) of such numbers"
)


def _hypot(a: Symbol, b: Symbol) -> Symbol:
    return casadi.sqrt(a * a + b * b)


class SymbolicNumber:
    """A number of the hand, or one that a function computed from it, on one `ExecutionPath`."""

    __slots__ = ("symbol", "way")
    __hash__: ClassVar[None]  # pyright: ignore[reportIncompatibleMethodOverride]

    def __init__(self, symbol: Symbol, way: ExecutionPath) -> None:
        self.symbol = symbol
        self.way = way

    def _combine(self, other: object, operation: Callable[[Symbol, Symbol], Symbol]) -> Any:
        """A number computed from this and another one; any other operand is left to Python, and arrays to NumPy."""
        if isinstance(other, SymbolicNumber):
            return SymbolicNumber(operation(self.symbol, other.symbol), self.way)
        if isinstance(other, Real | np.bool_):
            return SymbolicNumber(operation(self.symbol, float(other)), self.way)
        return NotImplemented

    def _compare(self, other: object, kind: Literal["<", "<=", "=="], swapped: bool = False) -> Any:
        if isinstance(other, SymbolicNumber):
            value: Any = other.symbol
        elif isinstance(other, Real | np.bool_):
            value = float(other)
        else:
            return NotImplemented
        return self.way.decide(value, self.symbol, kind) if swapped else self.way.decide(self.symbol, value, kind)

    def __add__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: a + b)

    __radd__ = __add__

    def __sub__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: a - b)

    def __rsub__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: b - a)

    def __mul__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: a * b)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: a / b)

    def __rtruediv__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: b / a)

    def __pow__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: a**b)

    def __rpow__(self, other: object) -> Any:
        return self._combine(other, lambda a, b: b**a)

    def __neg__(self) -> "SymbolicNumber":
        return SymbolicNumber(-self.symbol, self.way)

    def __pos__(self) -> "SymbolicNumber":
        return self

    def __abs__(self) -> "SymbolicNumber":
        return self if self >= 0.0 else -self

    def __lt__(self, other: object) -> Any:
        return self._compare(other, "<")

    def __le__(self, other: object) -> Any:
        return self._compare(other, "<=")

    def __gt__(self, other: object) -> Any:
        return self._compare(other, "<", swapped=True)

    def __ge__(self, other: object) -> Any:
        return self._compare(other, "<=", swapped=True)

    def __eq__(self, other: object) -> Any:
        return self._compare(other, "==")

    def __ne__(self, other: object) -> Any:
        equal = self._compare(other, "==")
        return equal if equal is NotImplemented else not equal

    def __bool__(self) -> bool:
        return not self.way.decide(self.symbol, 0.0, "==")

    def _refuse_conversion(self, *_: object) -> NoReturn:
        self.way.lose(_CONVERSION_MESSAGE)

    __float__ = __int__ = __index__ = __complex__ = __round__ = __floor__ = __ceil__ = __trunc__ = _refuse_conversion

    # For its functions of the same names, NumPy calls these methods of an object.

    def _apply(self, function: Callable[[Symbol], Symbol]) -> "SymbolicNumber":
        return SymbolicNumber(function(self.symbol), self.way)

    sqrt = partialmethod(_apply, casadi.sqrt)
    exp = partialmethod(_apply, casadi.exp)
    log = partialmethod(_apply, casadi.log)
    sin = partialmethod(_apply, casadi.sin)
    cos = partialmethod(_apply, casadi.cos)
    tan = partialmethod(_apply, casadi.tan)
    arcsin = partialmethod(_apply, casadi.asin)
    arccos = partialmethod(_apply, casadi.acos)
    arctan = partialmethod(_apply, casadi.atan)
    sinh = partialmethod(_apply, casadi.sinh)
    cosh = partialmethod(_apply, casadi.cosh)
    tanh = partialmethod(_apply, casadi.tanh)
    arctan2 = partialmethod(_combine, operation=casadi.atan2)
    hypot = partialmethod(_combine, operation=_hypot)


class SymbolicVector(np.ndarray[Any, np.dtype[Any]]):
    """A vector of the hand as an array of `SymbolicNumber`; its Euclidean norm is a `SymbolicNumber`, too."""

    @staticmethod
    def of(symbols: Symbol, way: ExecutionPath) -> "SymbolicVector":
        """Vector of a column of symbols."""
        numbers = np.empty(symbols.numel(), dtype=object)
        numbers[:] = [SymbolicNumber(symbols[i], way) for i in range(symbols.numel())]
        return numbers.view(SymbolicVector)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        # NumPy's own norm converts the numbers to floats.
        if func is np.linalg.norm and len(args) == 1 and not kwargs and args[0].ndim == 1:
            return np.sqrt(sum(number * number for number in args[0]))
        return super().__array_function__(func, types, args, kwargs)
