"""Validation in constructors: numbers within their bounds, and values of the type that a field is annotated with."""

import inspect
import reprlib
import types
from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from numbers import Integral, Real
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from controllers.errors import ParameterError
from geometry.arrays import Array

_NUMBER_KINDS: dict[object, tuple[type, str]] = {float: (Real, "a number"), int: (Integral, "a whole number")}
_KIND_NAMES: dict[object, str] = {bool: "True or False", str: "text", types.NoneType: "None"}


def checked(name: str, value: float, unit: str, least: float = 0.0, infinite: bool = False) -> float:
    """Return a gain or length as a float if it is at least `least` and finite (or infinite if allowed); else raise."""
    check_kind(name, value, float)
    number = float(value)
    if np.isnan(number) or number < least or (np.isinf(number) and not infinite):
        raise ParameterError(
            f"{name} must be {'' if infinite else 'finite and '}at least {least:g} {unit}, got {value}"
        )
    return number


def check_positive(what: str, part: object, *names: str) -> None:
    """Raise unless attributes of a part, by default all, are positive and finite; `what` is its name in the message."""
    for name in names or vars(part):
        value = getattr(part, name)
        if not (np.isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} of {what} is {value}; expected more than 0, and finite")


def check_field_types(part: object) -> None:
    """Raise if the value of a dataclass field is not of the type of its annotation.

    Raises
    ------
    ParameterError
        The message names the field, its value, and the type expected.
    """
    for name, kind in _field_kinds(type(part)).items():
        check_kind(name, getattr(part, name), kind)


@cache
def _field_kinds(part: type) -> dict[str, object]:
    hints = get_type_hints(part)
    return {field.name: hints[field.name] for field in fields(cast(Any, part))}


def check_kind(name: str, value: object, kind: object) -> None:
    """Raise if a value is not of a kind: a class, a number, one of several words, a sequence of a kind, or a union.

    A bool is not a number, and a class is not an instance of itself. Annotations that are not classes (arrays,
    functions) are not checked.

    Raises
    ------
    ParameterError
        The message gives the name, the value, and the kind expected.
    """
    if not _is_of_kind(value, kind):
        raise ParameterError(f"{name} is {reprlib.repr(value)}; expected {_kind_in_words(kind)}")


def check_callable(name: str, function: object, *arguments: str) -> None:
    """Raise if an object is not callable, or cannot be called with these arguments; it is not called here.

    Raises
    ------
    ParameterError
        The message gives the name, the function, and the arguments with which it is called.
    """
    expected = f"expected a function of {', '.join(arguments)}"
    if not callable(function):
        raise ParameterError(f"{name} is {reprlib.repr(function)}; {expected}")
    try:
        signature = inspect.signature(function)
    except ValueError:  # raised for some functions in C, whose signature is unknown
        return
    try:
        signature.bind(*arguments)
    except TypeError:
        called = getattr(function, "__name__", type(function).__name__)
        raise ParameterError(f"{name} is {called}{signature}; {expected}") from None


def numbers_of(name: str, values: npt.ArrayLike) -> Array:
    """Numbers of any shape as a new array; raises `ParameterError` for anything else or rows of unequal lengths."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"{name} is {reprlib.repr(values)}; expected numbers, with rows of equal lengths")
    return array.astype(np.float64)


def _is_of_kind(value: object, kind: Any) -> bool:
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(_is_of_kind(value, one) for one in inner)
    if origin is Literal:
        return isinstance(value, str) and value in inner
    if origin in (tuple, Sequence):
        if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str | bytes):
            return False
        several = cast(Sequence[object], value)
        return (_has_any_length(kind) or len(several) == len(inner)) and all(
            _is_of_kind(one, inner[0]) for one in several
        )
    if kind in _NUMBER_KINDS:
        return (
            isinstance(value, _NUMBER_KINDS[kind][0])
            and not isinstance(value, bool)
            and (kind is int or fits_float(value))
        )
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    return not isinstance(kind, type) or (isinstance(value, kind) and not isinstance(value, type))


def fits_float(value: Any) -> bool:
    """Whether a number is not too large for a float."""
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _has_any_length(kind: object) -> bool:
    """Whether a sequence may have any length."""
    return get_origin(kind) is not tuple or Ellipsis in get_args(kind)


def _kind_in_words(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return " or ".join(_kind_in_words(one) for one in inner)
    if origin is Literal:
        return f"one of {', '.join(inner)}"
    if origin in (tuple, Sequence):
        several = "a sequence" if inner[0] is Any else f"a sequence, each {_kind_in_words(inner[0])}"
        return several if _has_any_length(kind) else f"{len(inner)} numbers"
    return _NUMBER_KINDS[kind][1] if kind in _NUMBER_KINDS else _KIND_NAMES.get(kind) or kind.__name__
