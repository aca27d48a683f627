"""Output of the commands: the result in words, or with ``--json`` as JSON for other programs."""

from collections.abc import Iterable
from typing import Annotated, Any, Protocol, cast

import tyro

from experiments.files.json_text import json_text

Json = Annotated[bool, tyro.conf.arg(help="Print everything as JSON.")]
"""The option of every command that prints figures."""


class Result(Protocol):
    """A result with a description in words."""

    def lines(self) -> Iterable[str]:
        """The result in words, one sentence per line."""
        ...


def say(result: Result | Any, as_json: bool, lines: Iterable[str] | None = None) -> None:
    """Print a result on the standard output.

    Parameters
    ----------
    result : Result, mapping or sequence
        As JSON, a dataclass becomes an object of its fields, with ``lines`` added if it has them.
    as_json : bool
        Whether to print JSON instead of words.
    lines : iterable of str, optional
        The result in words, if it has no ``lines`` of its own.
    """
    if as_json:
        print(json_text(result), flush=True)
        return
    if lines is None:
        lines = cast(Iterable[str], result["lines"] if isinstance(result, dict) else result.lines())
    print("\n".join(lines), flush=True)
