"""Atomic writing of files: a file is complete, or it does not exist."""

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
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
