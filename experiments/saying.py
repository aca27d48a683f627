"""What a command prints: its result in words, or, with ``--json``, all of it for other programs."""

from collections.abc import Iterable
from typing import Annotated, Any, Protocol, cast

import tyro

from experiments.files.json_text import json_text

Json = Annotated[bool, tyro.conf.arg(help="Print everything as JSON.")]
"""The option of every command that prints figures."""


class Result(Protocol):
    """A result that says itself in words."""

    def lines(self) -> Iterable[str]:
        """A sentence each."""
        ...


def say(result: Result | Any, as_json: bool, lines: Iterable[str] | None = None) -> None:
    """Print a result on the standard output.

    Parameters
    ----------
    result : Result, mapping or sequence
        Dataclasses become objects of their fields, beside ``lines`` if it says itself in words.
    as_json : bool
        Whether another program reads it.
    lines : iterable of str, optional
        Its words, where it has none of its own.
    """
    if as_json:
        print(json_text(result), flush=True)
        return
    if lines is None:
        lines = cast(Iterable[str], result["lines"] if isinstance(result, dict) else result.lines())
    print("\n".join(lines), flush=True)
