"""Description of laws in plain data: names and values that can be hashed, compared and read."""

import hashlib
import pickle
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, cast
from uuid import uuid4

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.haptic_map.base import HapticMap
from controllers.haptic_map.map_stages import kernels_of
from geometry.arrays import Array

_MAX_LISTED = 16  # largest array that is listed; a larger one is described by a hash


def digest(*parts: Array | bytes) -> str:
    """SHA-256 of arrays and bytes, 16 hex digits."""
    total = hashlib.sha256()
    for part in parts:
        total.update(part if isinstance(part, bytes) else f"{part.shape}".encode())
        total.update(b"" if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return total.hexdigest()[:16]


def described(value: object) -> object:
    """A parameter as plain data.

    Numbers, strings and short arrays stay as they are, paths become text; curves, maps, functions and long arrays
    become a hash; a dataclass becomes its fields by name, a tuple or list (also a named tuple) a list of its described
    parts.
    """
    if isinstance(value, Trajectory):
        return {"curve": digest(value.packed())}
    if isinstance(value, HapticMap):
        stages, params, memory, _ = value.compiled()
        kernels = [getattr(kernel, "__name__", "") for kernel in kernels_of(stages)]
        return {"map": type(value).__name__, "kernels": kernels, "numbers": digest(params, memory)}
    if isinstance(value, np.ndarray):
        array = np.asarray(value, dtype=np.float64)
        return array.tolist() if array.size <= _MAX_LISTED else {"shape": list(array.shape), "numbers": digest(array)}
    if hasattr(value, "description"):
        return cast(Any, value).description()
    if is_dataclass(value) and not isinstance(value, type):
        return parts_of(value)
    if callable(value):
        return {"code": code_digest(value)}
    if isinstance(value, tuple | list):
        return [described(part) for part in cast("list[object]", value)]
    if isinstance(value, Path):
        return str(value)
    return value.item() if isinstance(value, np.generic) else value


def parts_of(value: Any) -> dict[str, object]:
    """Parameters of a dataclass by name."""
    return {field.name: described(getattr(value, field.name)) for field in fields(value)}


def code_digest(function: object) -> str:
    """Hash of what a function computes: its code, the constants that it reads, and the functions that it calls.

    Python functions contribute their code; modules, classes and built-in functions their names; every other value its
    pickled content. A value that cannot be pickled, such as an open file, changes the hash each time, so that no
    earlier result for such a law is ever reused.
    """
    return digest(*_content_parts(function, set()))


def _content_parts(value: object, seen: set[int]) -> Iterator[bytes]:
    value = getattr(value, "py_func", value)
    if isinstance(value, CodeType):
        yield value.co_code + repr((value.co_names, value.co_varnames, value.co_freevars)).encode()
        for constant in value.co_consts:
            yield from _content_parts(constant, seen)
    elif isinstance(value, FunctionType):
        if id(value) not in seen:
            seen.add(id(value))
            yield from _content_parts(value.__code__, seen)
            read = [value.__globals__[name] for name in _names_read(value.__code__) if name in value.__globals__]
            defaults = (*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values())
            for cell in (*defaults, *(c.cell_contents for c in value.__closure__ or ()), *read):
                yield from _content_parts(cell, seen)
    elif isinstance(value, _IDENTIFIED_BY_NAME):
        yield f"{getattr(value, '__module__', '')}.{value.__name__}".encode()
    else:
        try:
            yield pickle.dumps(value, protocol=4)
        except (pickle.PicklingError, TypeError, AttributeError, ValueError):
            yield uuid4().bytes


def _names_read(code: CodeType) -> Iterator[str]:
    """Names of globals that code may read, also in the comprehensions, lambdas and functions within it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names_read(constant)


_IDENTIFIED_BY_NAME = (ModuleType, type, BuiltinFunctionType, np.ufunc)
