"""User-defined force laws: the decorator `law` turns a function into a field, computed in Python or compiled."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, overload

import numpy.typing as npt
from numba import njit

from controllers.checks import check_kind
from controllers.errors import ParameterError
from controllers.fields.algebra.feed import Feed
from controllers.fields.algebra.instructions import TRACE_SIZE
from controllers.fields.algebra.law import Law, Program
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.own.function_law import FunctionLaw, place_of
from geometry.arrays import Array

_Function = Callable[..., npt.ArrayLike]


@njit
def given_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of `PythonLaw`: memory [F (3), τ (3)], which Python has written there."""
    for i in range(6):
        wrench[i] = memory[slot + i]


@dataclass(frozen=True, eq=False, repr=False)
class PythonLaw(FunctionLaw):
    """Field computed by a Python function at every tick of the servo.

    It composes like any other law: the loop calls the function between sensing and the compiled rest of the tick. State
    that the function keeps between ticks is not part of the field's memory. Parameters are those of `FunctionLaw`.
    """

    def _compose(self) -> Program:
        return Program.of(self, given_wrench, [], [0.0] * 6, feeds=(Feed(self.six_numbers, TRACE_SIZE),))


@overload
def law(function: _Function) -> PythonLaw: ...
@overload
def law(*, compiled: bool) -> Callable[[_Function], PythonLaw | CompiledLaw]: ...
def law(function: _Function | None = None, *, compiled: bool = False) -> Any:
    """Make a law from a function ``law(hand, parameter=default, ...)`` that returns a force, or force and moment.

    ::

        @law
        def floor(hand, k=500.0, b=3.0):
            depth = -1e-3 - hand.p[2]
            return (0, 0, max(0.0, k * depth - b * hand.v[2])) if depth > 0 else (0, 0, 0)

    is a law with these parameters, and ``floor(k=300.0)`` the same law with another stiffness. With
    ``@law(compiled=True)`` numba compiles the function, and the servo need not call Python.

    Parameters
    ----------
    function : callable
        From a `controllers.state.HandState` to three numbers, the force F_H [N], or six, with the moment [N m].
    compiled : bool
        Whether the function is compiled.

    Raises
    ------
    ParameterError
        If the function is called ``limited``, its first argument is not ``hand``, another argument has no number as its
        default, or it cannot be compiled.
    """
    check_kind("compiled", compiled, bool)
    if function is not None and not callable(function):
        raise ParameterError(f"a law is made from a function law(hand, …); got {function!r}")
    make = CompiledLaw if compiled else PythonLaw

    def decorate(function: _Function) -> PythonLaw | CompiledLaw:
        plain = getattr(function, "py_func", function)
        if getattr(plain, "__name__", "") == Law.limited.__name__:
            raise ParameterError(
                f"{place_of(plain)} cannot be called {Law.limited.__name__}: a sweep finds the bounds of a limited "
                "field under this name; expected another name"
            )
        return make(plain, _parameters(plain))

    return decorate if function is None else decorate(function)


def _parameters(function: _Function) -> dict[str, float]:
    try:
        given = list(inspect.signature(function).parameters.values())
    except ValueError:  # some types and functions in C have no signature
        raise ParameterError(f"a law is made from a function law(hand, …); got {function!r}") from None
    if alone := [one.name for one in given if one.kind is one.POSITIONAL_ONLY]:
        raise ParameterError(
            f"{', '.join(alone)} of {place_of(function)} can be given by position only; leave out the / after it"
        )
    if not given or given[0].name != "hand" or given[0].kind is not given[0].POSITIONAL_OR_KEYWORD:
        got = given[0] if given else "no argument"
        raise ParameterError(f"the first argument of {place_of(function)} must be hand, got {got}")
    parameters: dict[str, float] = {}
    for other in given[1:]:
        if other.kind is not other.POSITIONAL_OR_KEYWORD or other.default is other.empty:
            raise ParameterError(
                f"argument {other} of {place_of(function)} must be a parameter with a number as its default, "
                f"as in {other.name}=1.0"
            )
        parameters[other.name] = other.default
    return parameters
