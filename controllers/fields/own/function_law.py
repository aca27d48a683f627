"""Force laws given by a user's Python function with named parameters."""

import math
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from numbers import Real
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from controllers.checks import fits_float
from controllers.errors import ControllerError, ParameterError
from controllers.fields.algebra.description import code_digest
from controllers.fields.algebra.law import Law
from controllers.state import HandState, Wrench
from geometry.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class FunctionLaw(Law):
    """Field F(hand; parameters), computed by a function; made by `controllers.fields.own.own_law.law`.

    The object is a law with its current parameters; a call with keyword arguments returns the same law with those
    parameters replaced.

    Parameters
    ----------
    function : callable
        ``function(hand, **parameters)``, from a `HandState` to the force F_H [N], or the force and the moment [N m]:
        three or six numbers.
    parameters : mapping of str to float
        Values by name.

    Raises
    ------
    ParameterError
        If a parameter is not a finite number; on evaluation, if the function does not return three or six numbers.
    """

    function: Callable[..., npt.ArrayLike]
    parameters: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        for name, value in self.parameters.items():
            if not isinstance(value, Real) or not fits_float(value) or not math.isfinite(value):
                raise ParameterError(f"{name} of {self.place} must be a finite number, got {reprlib.repr(value)}")
        given: Mapping[str, Any] = self.parameters
        plain = {name: float(value) if isinstance(value, Fraction) else value for name, value in given.items()}
        object.__setattr__(self, "parameters", plain)  # NumPy does not accept a Fraction as a number

    def __call__(self, **parameters: float) -> Self:
        """The same law with other parameters.

        Raises
        ------
        ParameterError
            If the law has no parameter of that name, or a value is not a finite number.
        """
        unknown = [name for name in parameters if name not in self.parameters]
        if unknown:
            raise ParameterError(
                f"{self.place} has no parameter {', '.join(unknown)}; there are {', '.join(self.parameters) or 'none'}"
            )
        return replace(self, parameters={**self.parameters, **parameters})

    def __repr__(self) -> str:
        return f"{self.name}({', '.join(f'{name}={value!r}' for name, value in self.parameters.items())})"

    @property
    def name(self) -> str:
        """Name of the function."""
        return getattr(self.function, "__name__", type(self.function).__name__)

    @property
    def place(self) -> str:
        """The function, its file and its line, for messages."""
        return place_of(self.function)

    def six_numbers(self, hand: HandState) -> Array:
        """Force [N] and moment [N m] of the function at a hand state, shape (6,); a moment not returned is zero."""
        result: Any = self.function(hand, **self.parameters)
        if result is None:
            raise ParameterError(
                f"{self.place} returned None; expected a return statement with three numbers, the force [N], or six, "
                "with the moment [N m]"
            )
        try:
            numbers = np.asarray(result)
            if numbers.dtype.kind not in "biufO" or np.ma.is_masked(result):  # text, complex; masked: no number
                raise TypeError
            numbers = numbers.astype(np.float64)
        except ControllerError:  # from a certificate's symbol, whose message says why it is not a number
            raise
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(
                f"{self.place} gave {reprlib.repr(result)}; expected a force of three numbers [N], or six with the "
                "moment [N m]"
            ) from None
        if numbers.shape not in ((3,), (6,)):
            raise ParameterError(
                f"{self.place} gave numbers of shape {numbers.shape}; expected a force of three [N], or six with the "
                "moment [N m]"
            )
        return numbers if len(numbers) == 6 else np.concatenate([numbers, np.zeros(3)])

    def wrench(self, hand: HandState) -> Wrench:
        """Force and moment at one hand state.

        Raises
        ------
        ParameterError
            If they are not finite. In a run, such a wrench latches the limiter's fault instead.
        """
        wrench = super().wrench(hand)
        if np.isfinite(hand.vector()).all() and not np.isfinite(np.concatenate(wrench)).all():
            raise ParameterError(f"{self.place} gave {wrench.force} N and {wrench.torque} N m; expected finite numbers")
        return wrench

    def description(self) -> dict[str, object]:
        """Name, parameters by name, and a hash of the code that runs."""
        return {"law": self.name, "parameters": dict(self.parameters), "code": code_digest(self.function)}


def place_of(function: Any) -> str:
    """A function, its file and its line, for messages."""
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    name = getattr(function, "__name__", type(function).__name__)
    return f"law {name}" if code is None else f"law {name} ({code.co_filename}, line {code.co_firstlineno})"
