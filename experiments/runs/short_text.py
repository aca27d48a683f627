"""Short text of the parts of a simulation, for a prompt: values that are not defaults, clips and functions by name."""

import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, cast

from pydantic.fields import FieldInfo

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Law, Program
from controllers.fields.own.function_law import FunctionLaw
from models.mocap.motion.clip import Clip

# Values of a part or of a sequence that are shown: those of a simulation then fit into some 200 characters.
_MAX_SHOWN = 4


def name_of(law: Law) -> str:
    """Name of a law: of a user-defined one that of its function, otherwise that of its class."""
    return law.name if isinstance(law, FunctionLaw) else type(law).__name__


def short_text(part: object) -> str:
    """A part as ``Name(field=value)`` with the fields that differ from their defaults, without memory addresses."""
    if isinstance(part, Clip):
        return repr(part.name)
    if isinstance(part, Trajectory):
        return repr(part)
    if isinstance(part, Program):
        return f"<field of {', '.join(map(name_of, part.laws))}>"
    if isinstance(part, FunctionLaw):
        return part.name
    if is_dataclass(part) and not isinstance(part, type):
        return f"{type(part).__name__}({_join_short(_changed_fields(part))})"
    if isinstance(part, Sequence) and not isinstance(part, str | bytes):
        return f"[{_join_short(map(short_text, cast(Sequence[object], part)))}]"
    if isinstance(part, float):
        return f"{part:g}"
    named = getattr(part, "__name__", None)
    if named is not None:
        return str(named)
    return f"<{type(part).__name__}>" if type(part).__repr__ is object.__repr__ else reprlib.repr(part)


def _changed_fields(part: Any) -> Iterable[str]:
    """Fields of a part that are shown and differ from their defaults."""
    for field in fields(part):
        value = getattr(part, field.name)
        if field.repr and not _is_default(field, value):
            yield f"{field.name}={short_text(value)}"


def _is_default(field: Field[Any], value: object) -> bool:
    default = field.default_factory() if field.default_factory is not MISSING else field.default
    if isinstance(default, FieldInfo):  # of a part of a configuration
        default = default.default
    return value is default or (type(value) is type(default) and bool(value == default))


def _join_short(texts: Iterable[str]) -> str:
    several = list(texts)
    return ", ".join(several[:_MAX_SHOWN] + ["…"] * (len(several) > _MAX_SHOWN))
