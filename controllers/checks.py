"""Validation in constructors: numbers within their bounds, and values of the kind that a field's annotation says."""

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
from controllers.state import Array

_NUMBERS: dict[object, tuple[type, str]] = {float: (Real, "a number"), int: (Integral, "a whole number")}
_WORDS: dict[object, str] = {bool: "True or False", str: "text", types.NoneType: "None"}


def checked(name: str, value: float, unit: str, least: float = 0.0, infinite: bool = False) -> float:
    """The value, a gain or length, if it is at least `least` and finite (or infinite, where allowed); else raises."""
    of_kind(name, value, float)
    number = float(value)
    if np.isnan(number) or number < least or (np.isinf(number) and not infinite):
        raise ParameterError(
            f"{name} must be {'' if infinite else 'finite and '}at least {least:g} {unit}, got {value}"
        )
    return number


def check_kinds(part: object) -> None:
    """Refuse a field of a dataclass whose value is of another kind than its annotation.

    Raises
    ------
    ParameterError
        The field, its value, and what would be right.
    """
    for name, kind in _kinds(type(part)).items():
        of_kind(name, getattr(part, name), kind)


@cache
def _kinds(part: type) -> dict[str, object]:
    hints = get_type_hints(part)
    return {field.name: hints[field.name] for field in fields(cast(Any, part))}


def of_kind(name: str, value: object, kind: object) -> None:
    """Refuse a value that is not of a kind: a class, a number, one of several words, a sequence of a kind, a union.

    A truth value is no number and a class no object of it; what is an array or a function is not looked at.

    Raises
    ------
    ParameterError
        The name, the value, and what would be right.
    """
    if not _is(value, kind):
        raise ParameterError(f"{name} is {reprlib.repr(value)}; expected {_expected(kind)}")


def takes(name: str, function: object, *arguments: str) -> None:
    """Refuse what is no function, or one that cannot be called with so many arguments, without a call.

    Raises
    ------
    ParameterError
        The name, the function, and the arguments with which it is called.
    """
    expected = f"expected a function of {', '.join(arguments)}"
    if not callable(function):
        raise ParameterError(f"{name} is {reprlib.repr(function)}; {expected}")
    try:
        found = inspect.signature(function)
    except ValueError:  # of some functions in C, which do not tell
        return
    try:
        found.bind(*arguments)
    except TypeError:
        called = getattr(function, "__name__", type(function).__name__)
        raise ParameterError(f"{name} is {called}{found}; {expected}") from None


def numbers_of(name: str, values: npt.ArrayLike) -> Array:
    """Numbers of any shape as a new array; raises `ParameterError` for anything else or rows of unequal lengths."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"{name} is {reprlib.repr(values)}; expected numbers, with rows of equal lengths")
    return array.astype(np.float64)


def _is(value: object, kind: Any) -> bool:
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(_is(value, one) for one in inner)
    if origin is Literal:
        return isinstance(value, str) and value in inner
    if origin in (tuple, Sequence):
        if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str | bytes):
            return False
        several = cast(Sequence[object], value)
        return (_open(kind) or len(several) == len(inner)) and all(_is(one, inner[0]) for one in several)
    if kind in _NUMBERS:
        return (
            isinstance(value, _NUMBERS[kind][0]) and not isinstance(value, bool) and (kind is int or fits_float(value))
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


def _open(kind: object) -> bool:
    """Whether a sequence may have any length."""
    return get_origin(kind) is not tuple or Ellipsis in get_args(kind)


def _expected(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return " or ".join(_expected(one) for one in inner)
    if origin is Literal:
        return f"one of {', '.join(inner)}"
    if origin in (tuple, Sequence):
        several = "a sequence" if inner[0] is Any else f"a sequence, each {_expected(inner[0])}"
        return several if _open(kind) else f"{len(inner)} numbers"
    return _NUMBERS[kind][1] if kind in _NUMBERS else _WORDS.get(kind) or kind.__name__
