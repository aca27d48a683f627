"""Files that carry a hash of their content."""

import hashlib
from pathlib import Path

from geometry.whole_files import atomic_file

_HASH_SIZE = hashlib.sha256().digest_size


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
