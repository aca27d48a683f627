"""The interval that a number of a configuration must lie in, kept with its field; errors name the number's option."""

from collections.abc import Iterator
from dataclasses import Field, field, fields, is_dataclass
from math import inf, isnan
from typing import NamedTuple, TypeVar

from controllers.errors import ParameterError

_INTERVAL = "interval"
_Number = TypeVar("_Number", bound="float | None")


class Interval(NamedTuple):
    """Numbers from `least` on, without it if `open`, up to infinity, with it if `infinite`; `unit` is for messages."""

    least: float
    unit: str
    open: bool
    infinite: bool

    def __contains__(self, value: object) -> bool:
        if not isinstance(value, int | float) or isnan(value) or (value == inf and not self.infinite):
            return False
        return value > self.least if self.open else value >= self.least

    def __str__(self) -> str:
        bound = f"more than {self.least:g}" if self.open else f"{self.least:g}"
        return f"{bound}{self.unit and ' ' + self.unit}{'' if self.open else ' or more'}" + ", and finite" * (
            not self.infinite
        )


def at_least(least: float, default: _Number, unit: str = "", infinite: bool = False) -> _Number:
    """Field of a dataclass with a default, whose numbers begin with `least`."""
    return field(default=default, metadata={_INTERVAL: Interval(least, unit, False, infinite)})


def above(least: float, default: _Number, unit: str = "") -> _Number:
    """Field of a dataclass with a default, whose numbers are greater than `least`."""
    return field(default=default, metadata={_INTERVAL: Interval(least, unit, True, False)})


def check_numbers(options: object) -> None:
    """Check every number of a dataclass that has an interval, and of dataclasses in it; None is no number.

    Raises
    ------
    ParameterError
        If one lies outside; the message names its option of the command line.
    """
    for option, value in _numbers(options):
        interval: Interval = option.metadata[_INTERVAL]
        if value is not None and value not in interval:
            raise ParameterError(f"--{option.name.replace('_', '-')} is {value:g}; expected {interval}")


def _numbers(options: object) -> Iterator[tuple[Field[object], float | None]]:
    if not is_dataclass(options):
        return
    for option in fields(options):
        value = getattr(options, option.name)
        if _INTERVAL in option.metadata:
            yield option, value
        else:
            yield from _numbers(value)
