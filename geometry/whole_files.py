"""Files that are complete or do not exist, and files that carry a hash of their content."""

import hashlib
import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_HASH_SIZE = hashlib.sha256().digest_size


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


def write_hashed(path: Path, content: bytes) -> None:
    """Write content with its hash, atomically, into a folder that is created if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path) as file:
        file.write(hashlib.sha256(content).digest() + content)


def read_hashed(path: Path) -> bytes | None:
    """Content that `write_hashed` wrote; None if the file is missing, truncated or changed."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    content = stored[_HASH_SIZE:]
    return content if hashlib.sha256(content).digest() == stored[:_HASH_SIZE] else None
