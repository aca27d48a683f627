"""Paths as Python is given them: text or a `pathlib.Path`."""

from pathlib import Path

from controllers.checks import check_kind
from controllers.errors import ParameterError


def given_path(name: str, value: str | Path) -> Path:
    """The path in an argument; empty text, which would mean the working directory, is refused.

    Raises
    ------
    ParameterError
        If it is neither text nor a path, is empty, or has a null character.
    """
    check_kind(name, value, str | Path)
    if not str(value):
        raise ParameterError(f"{name} is empty; expected a path")
    if "\0" in str(value):
        raise ParameterError(f"{name} is {str(value)!r}; expected a path without a null character")
    return Path(value)
