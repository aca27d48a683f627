"""JSON for other programs to read."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np


def json_text(value: object) -> str:
    """Indented JSON of a value; numbers that are not finite, which JSON lacks, become null.

    A dataclass or named tuple becomes an object of its fields; the outermost one also gets its ``lines``, if it has a
    method of that name.
    """
    plain, lines = _plain(value), getattr(value, "lines", None)
    if callable(lines) and isinstance(plain, dict):
        plain = cast(dict[str, object], plain) | {"lines": list(cast(Callable[[], Any], lines)())}
    return json.dumps(plain, indent=2, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        value = cast(object, value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in cast(Mapping[object, object], value).items()}
    names = _field_names(value)
    if names:
        return {name: _plain(getattr(value, name)) for name in names}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in cast(list[object], value)]
    return value


def _field_names(value: object) -> list[str]:
    """Fields of a dataclass or a named tuple."""
    if is_dataclass(value) and not isinstance(value, type):
        return [field.name for field in fields(value)]
    return list(getattr(value, "_fields", ()))
