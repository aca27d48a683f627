"""Disk cache of arrays that take long to compute, under a hash of everything on which they depend."""

import hashlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from experiments.files.atomic_file import atomic_file
from geometry.arrays import Array


def cached_array(
    folder: Path,
    name: str,
    made_of: Iterable[npt.NDArray[np.generic]],
    shape: tuple[int, ...],
    find: Callable[[], Array],
) -> Array:
    """The cached array of these inputs; if there is none, it is computed and stored.

    A file carries a hash of its content: one that is truncated, changed or of another shape is not used. If the file
    cannot be written, the result is not cached.

    Parameters
    ----------
    folder : Path
        Folder of the cache; created if it is missing.
    name : str
        Name of the kind of array, the first part of the file's name.
    made_of : iterable of arrays
        Everything on which the result depends.
    shape : tuple of int
        Shape of the result; the first number may be −1, for any number of rows.
    find : callable
        Computes the result.
    """
    path = _cache_file(folder, name, made_of)
    if (cached := _read(path, shape)) is not None:
        return cached
    found = np.ascontiguousarray(find(), dtype=np.float64)
    with suppress(OSError):
        _write(path, _digest([found.ravel()]) + found.tobytes())
    return found


def is_cached(folder: Path, name: str, made_of: Iterable[npt.NDArray[np.generic]], shape: tuple[int, ...]) -> bool:
    """Whether `cached_array` would return a cached array."""
    return _read(_cache_file(folder, name, made_of), shape) is not None


_DIGEST_SIZE = hashlib.sha256().digest_size


def _cache_file(folder: Path, name: str, made_of: Iterable[npt.NDArray[np.generic]]) -> Path:
    return folder / f"{name}-{_digest(made_of).hex()}.kept"


def _read(path: Path, shape: tuple[int, ...]) -> Array | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    rows, rest = divmod(len(content) - _DIGEST_SIZE, 8 * int(np.prod(shape[1:])))
    if rest or rows < 0 or shape[0] not in (-1, rows):
        return None
    values = np.frombuffer(content[_DIGEST_SIZE:])
    return values.reshape(shape).copy() if _digest([values]) == content[:_DIGEST_SIZE] else None


def _digest(arrays: Iterable[npt.NDArray[np.generic]]) -> bytes:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()


def _write(path: Path, content: bytes) -> None:
    """Write a file atomically, also when two processes write it at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path) as file:
        file.write(content)
