"""Error messages for Python callers: options of the command line become keyword arguments.

Messages are written with options. Functions that are called from Python translate them to keywords
(`with_keyword_messages`); the command line, which may call the same functions, prints the original message
(`option_message`).
"""

import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from geometry.errors import HvfError

_F = TypeVar("_F", bound=Callable[..., Any])
_OPTION_PATTERN = re.compile(
    r"`[^`]*`"  # a whole command stays as it is typed
    r"|(?<![\w-])--(?P<chosen>mode|map|user|person|figure) (?P<kind>[a-z][a-z-]{2,})"
    r"|(?<![\w-])--(?P<name>[a-z]+(?:[-.][a-z0-9]+)*)(?: (?P<number>-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?![\w.]*\d))?"
)


_ORIGINAL_MESSAGE = "options"  # attribute of an error: its message as written, with options


def option_message(error: Exception) -> str:
    """Message of an error in terms of options, even if `with_keyword_messages` has translated it to keywords."""
    return vars(error).get(_ORIGINAL_MESSAGE, str(error))


def to_keywords(text: str, **others: str) -> str:
    """A message that names keywords, ``wall_margin=0.1`` for ``--wall-margin 0.1``.

    Parameters
    ----------
    text : str
        Message that names options.
    **others : str
        Keywords whose names differ from those of the options, by option.
    """

    def keyword(found: re.Match[str]) -> str:
        if found["chosen"] is not None:
            return f'{others.get(found["chosen"], found["chosen"])}="{found["kind"]}"'
        if found["name"] is None:
            return found[0]
        name = found["name"].replace("-", "_")
        return others.get(name, name) + (f"={found['number']}" if found["number"] else "")

    return _OPTION_PATTERN.sub(keyword, text)


def with_keyword_messages(**others: str) -> Callable[[_F], _F]:
    """Decorator of a function that is called from Python: its errors name keywords; see `to_keywords`."""

    def decorate(function: _F) -> _F:
        @wraps(function)
        def wrapper(*arguments: Any, **given: Any) -> Any:
            try:
                return function(*arguments, **given)
            except HvfError as error:
                vars(error).setdefault(_ORIGINAL_MESSAGE, str(error))
                error.args = (to_keywords(str(error), **others),)
                raise

        return cast(_F, wrapper)

    return decorate
