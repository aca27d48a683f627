"""Parts of a configuration: frozen dataclasses that pydantic validates when they are made.

A part takes keyword arguments. A wrong one raises `ParameterError`, with the keyword, its value and what is expected.
"""

import codecs
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast, dataclass_transform, get_args, get_origin

import numpy as np
from pydantic import ConfigDict, Field, GetCoreSchemaHandler, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked_dataclass
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from controllers.errors import ParameterError
from experiments.config.keywords import option_message, to_keywords, with_keyword_messages
from sim.errors import SimError

_Part = TypeVar("_Part")
MAX_NUMBER = 1e15
"""Upper bound of the numbers of a part, in SI units: its square, and that of a difference, is still finite."""
INFINITE = "Infinity"
"""How pydantic writes an infinite number in JSON, which has none."""
_CONFIG = ConfigDict(extra="forbid", ser_json_inf_nan="strings", arbitrary_types_allowed=True)


def at_least(
    least: float, *, default: Any = ..., unit: str = "", infinite: bool = False, most: float = MAX_NUMBER
) -> Any:
    """Number of a part that is `least` or more, at most `most`, by default finite; `unit` is for messages.

    Without a default it is used in an annotation, and the field has an ordinary default that the command line reads.
    """
    limit = None if infinite else most
    return Field(default=default, ge=least, le=limit, allow_inf_nan=infinite, json_schema_extra={"unit": unit})


def whole_number(least: int, below: int = 2**63, *, default: Any = ...) -> Any:
    """Whole number of a part that is `least` or more and less than `below`, by default within the 64 bits of a file."""
    return Field(default=default, ge=least, lt=below)


def above(least: float, *, default: Any = ..., unit: str = "", most: float = MAX_NUMBER) -> Any:
    """Number of a part that is greater than `least`, at most `most`, and finite."""
    return Field(default=default, gt=least, le=most, allow_inf_nan=False, json_schema_extra={"unit": unit})


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(at_least, above, whole_number, Field))
def part(cls: type[_Part]) -> type[_Part]:
    """Make a class a part of a configuration."""
    cast(Any, cls).__get_pydantic_core_schema__ = classmethod(_schema)
    part_class = cast(Any, checked_dataclass(config=_CONFIG, frozen=True, kw_only=True)(cls))  # pyright: ignore
    init, named = part_class.__init__, [field for field in fields(part_class) if field.init]
    places = [field.name for field in named if not field.kw_only]

    @with_keyword_messages()
    def __init__(self: object, *arguments: Any, **values: Any) -> None:
        if len(arguments) > len(places):
            raise ParameterError(
                f"{part_class.__name__} is given {arguments[len(places)]!r} without a name; "
                f"expected some of {', '.join(f'{field.name}=' for field in named)}"
            )
        try:
            init(self, **dict(zip(places, arguments, strict=False)), **values)
        except ValidationError as error:
            own = error.errors()[0].get("ctx", {}).get("error")  # raised by the part itself
            raise (
                own if isinstance(own, ParameterError) else ParameterError(validation_message(error, part_class))
            ) from None

    part_class.__init__ = __init__
    return cast(type[_Part], part_class)


def _schema(cls: type, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
    """Pydantic's schema of a part, without conversion of text or bool to a number, or of these to bool.

    Pydantic's own strict mode is not used: it also refuses lists for tuples, and NumPy's whole numbers.
    """
    return _without_coercion(handler.resolve_ref_schema(handler(source)), handler)


def _without_coercion(schema: Any, handler: GetCoreSchemaHandler) -> Any:
    if isinstance(schema, list):
        return [_without_coercion(inner, handler) for inner in cast(list[Any], schema)]
    if not isinstance(schema, dict):
        return schema
    inner = cast(dict[str, Any], schema)
    kind = inner.get("type")
    if kind == "definition-ref":
        inner = {**handler.resolve_ref_schema(cast(CoreSchema, inner))}
        if hasattr(inner["cls"], "__get_pydantic_core_schema__"):
            return schema
        del inner["ref"]  # a dataclass that is no part, such as a push
    check = _check_number if kind in ("float", "int") else _check_bool if kind == "bool" else None
    if check is not None:
        return core_schema.no_info_before_validator_function(check, cast(CoreSchema, inner))
    return {key: _without_coercion(value, handler) for key, value in inner.items()}


def _check_number(value: object) -> object:
    if isinstance(value, str) and value == INFINITE:
        return np.inf
    if isinstance(value, str | bytes | bool | np.bool_):
        raise PydanticCustomError("number", "expected a number")
    return value


def _check_bool(value: object) -> object:
    if not isinstance(value, bool | np.bool_):
        raise PydanticCustomError("truth", "expected true or false")
    return value


def to_json(value: object) -> str:
    """A part as JSON text."""
    return TypeAdapter(type(value)).dump_json(value, indent=2).decode() + "\n"  # pyright: ignore


def to_dict(value: object) -> dict[str, object]:
    """A part as nested dictionaries and lists."""
    return TypeAdapter(type(value)).dump_python(value, mode="python")  # pyright: ignore


def from_json(cls: type[_Part], text: str | bytes, where: str) -> _Part:
    """A part from JSON text.

    Raises
    ------
    ParameterError
        If it is not one; the message begins with `where`.
    """
    try:
        return TypeAdapter(cls).validate_json(text)
    except ValidationError as error:
        raise ParameterError(f"{where}: {to_keywords(validation_message(error, cls))}") from None


def from_file(cls: type[_Part], path: Path) -> _Part:
    """A part from a JSON file.

    Raises
    ------
    ParameterError
        If it holds none; the message begins with the file.
    SimError
        If it cannot be read.
    """
    try:
        text = path.read_bytes().removeprefix(codecs.BOM_UTF8)  # of an editor on Windows
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected the JSON of a configuration") from None
    return from_json(cls, text, str(path))


def from_dict(cls: type[_Part], values: Mapping[str, object], where: str) -> _Part:
    """A part from nested dictionaries, as `from_json`."""
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        raise ParameterError(f"{where}: {to_keywords(validation_message(error, cls))}") from None


_EXPECTED = {
    "float_type": "a number", "int_type": "a whole number", "int_from_float": "a whole number", "string_type": "text",
    "string_too_short": "text that is not empty", "tuple_type": "a list", "dict_type": "values by name",
    "dataclass_type": "values by name, or {class_name}",
}  # fmt: skip
"""What is expected, where pydantic's own message names types of its schema."""


def validation_message(error: ValidationError, cls: type) -> str:
    """The first thing that is wrong, in one line: option, value, and what would be right."""
    first = error.errors(include_url=False)[0]
    place, kind, context = first["loc"], first["type"], first.get("ctx", {})
    names = [str(name) for name in place if not isinstance(name, int)]
    option = "--" + names[-1].replace("_", "-") if names else cls.__name__
    field = _field_at(cls, place)
    unit = "" if field is None else (field.json_schema_extra or {}).get("unit", "")
    unit = f" {unit}" if unit else ""
    finite = ", and finite"
    if kind in ("greater_than_equal", "greater_than", "finite_number"):
        least = context.get("ge", context.get("gt"))
        if least is None and field is not None:
            least = next((getattr(m, a) for m in field.metadata for a in ("ge", "gt") if hasattr(m, a)), None)
        exclusive = kind == "greater_than" or (field is not None and any(hasattr(m, "gt") for m in field.metadata))
        bound = f"more than {least:g}{unit}" if exclusive else f"{least:g}{unit} or more"
        infinite = field is not None and any(getattr(m, "allow_inf_nan", None) is True for m in field.metadata)
        return f"{option} is {float(first['input']):g}; expected {bound}{'' if infinite else finite}"
    if kind in ("unexpected_keyword_argument", "extra_forbidden", "unexpected_positional_argument"):
        part_type = _part_at(cls, place[:-1])
        known = ", ".join(field.name for field in fields(cast(Any, part_type)))
        return f"{'.'.join(map(str, place))} is not known; expected some of {known}"
    if kind == "less_than_equal":
        return f"{option} is {float(first['input']):g}; expected at most {context['le']:g}{unit}"
    if kind == "less_than":
        return f"{option} is {first['input']}; expected less than {context['lt']}"
    if kind == "literal_error":
        return f"{option} is {first['input']!r}; expected {context['expected']}"
    if kind == "union_tag_invalid":
        return f"{'.'.join(names)} is of kind {context['tag']!r}; expected {context['expected_tags']}"
    if kind == "json_invalid":
        return f"is not JSON ({context['error']}); expected a configuration"
    if kind == "value_error":  # raised by parts, actions and persons themselves
        return option_message(context["error"])
    where = ".".join(map(str, place))
    if kind in ("missing", "missing_argument"):
        return f"{where} is missing"
    if kind in _EXPECTED:
        return f"{where or cls.__name__} is {first['input']!r}; expected {_EXPECTED[kind].format(**context)}"
    return f"{where or cls.__name__} is {first['input']!r}; {first['msg'][0].lower()}{first['msg'][1:]}"


def _field_at(cls: type, place: Sequence[str | int]) -> Any:
    """Pydantic's field at a place of a part; None where there is none."""
    for depth in reversed(range(len(place))):
        table = getattr(_part_at(cls, place[:depth]), "__pydantic_fields__", {})
        if place[depth] in table:
            return table[place[depth]]
    return None


def _part_at(cls: type, place: Sequence[str | int]) -> type:
    """The part at a place within another part."""
    for name in place:
        if get_origin(cls) is dict:  # maps names to parts
            cls = get_args(cls)[1]
            continue
        table = getattr(cls, "__pydantic_fields__", {})
        if name in table:
            cls = table[name].annotation
        # In a union, the place holds the kind of the member, or its name.
        cls = next((m for m in get_args(cls) if name in (getattr(m, "kind", None), getattr(m, "__name__", ""))), cls)
        members = [m for m in get_args(cls) if m is not type(None)]
        cls = members[0] if len(members) == 1 else cls
    return cls
