"""Files that are complete or do not exist."""

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def atomic_file(path: Path) -> Generator[BinaryIO]:
    """A file to be written that takes the place of `path` once it is closed; until then, `path` is as it was.

    Whatever interrupts the block (an error, a full disk, Ctrl-C) removes it. Two processes may write at once.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    target = path.resolve()  # a symbolic link stays a link
    draft = target.with_name(f"{target.name}.{secrets.token_hex(4)}")
    try:
        with draft.open("xb") as file:
            yield file
        os.replace(draft, target)
    except BaseException as error:
        draft.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (None, str(draft)):  # that of a full disk names no file
            error.filename = str(path)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file, UTF-8, atomically; raises as `atomic_file`."""
    with atomic_file(path) as file:
        file.write(text.encode())
