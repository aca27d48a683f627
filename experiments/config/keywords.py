"""Messages in the words of Python: what they call an option of the command line is there a keyword argument.

They are written with options. What is called from Python puts them into keywords (`in_keywords`); the command line,
which may be what calls, prints what was written (`in_options`).
"""

import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from controllers.errors import ControllerError
from models.errors import ModelError
from sim.errors import SimError

_F = TypeVar("_F", bound=Callable[..., Any])
_OPTION_PATTERN = re.compile(
    r"`[^`]*`"  # a whole command stays as it is typed
    r"|(?<![\w-])--(?P<chosen>mode|map|user|person|figure) (?P<kind>[a-z][a-z-]{2,})"
    r"|(?<![\w-])--(?P<name>[a-z]+(?:[-.][a-z0-9]+)*)(?: (?P<number>-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?![\w.]*\d))?"
)


_ORIGINAL_MESSAGE = "options"  # attribute of an error: its message as it was written, with options


def in_options(error: Exception) -> str:
    """Message of an error as the command line says it, also where `in_keywords` has put it into keywords."""
    return vars(error).get(_ORIGINAL_MESSAGE, str(error))


def keywords(text: str, **others: str) -> str:
    """A message that names keywords, ``wall_margin=0.1`` for ``--wall-margin 0.1``.

    Parameters
    ----------
    text : str
        Message that names options.
    **others : str
        Keywords of another name, by that of the option.
    """

    def keyword(found: re.Match[str]) -> str:
        if found["chosen"] is not None:
            return f'{others.get(found["chosen"], found["chosen"])}="{found["kind"]}"'
        if found["name"] is None:
            return found[0]
        name = found["name"].replace("-", "_")
        return others.get(name, name) + (f"={found['number']}" if found["number"] else "")

    return _OPTION_PATTERN.sub(keyword, text)


def in_keywords(**others: str) -> Callable[[_F], _F]:
    """Decorator of a function that is called from Python: its errors name keywords; see `keywords`."""

    def decorate(function: _F) -> _F:
        @wraps(function)
        def wrapper(*arguments: Any, **given: Any) -> Any:
            try:
                return function(*arguments, **given)
            except (ControllerError, ModelError, SimError) as error:
                vars(error).setdefault(_ORIGINAL_MESSAGE, str(error))
                error.args = (keywords(str(error), **others),)
                raise

        return cast(_F, wrapper)

    return decorate
