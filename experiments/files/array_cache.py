"""Disk cache of arrays that take long to compute, under a hash of everything on which they depend."""

import hashlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array
from geometry.whole_files import read_hashed, write_hashed
from sim.compilation.sources import results_folder


def cached_array(
    module: str,
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
    module : str
        Dotted name of the module that computes the result: a change of its code invalidates what is cached.
    name : str
        Name of the kind of array, the first part of the file's name.
    made_of : iterable of arrays
        Everything on which the result depends.
    shape : tuple of int
        Shape of the result; the first number may be −1, for any number of rows.
    find : callable
        Computes the result.
    """
    path = _cache_file(module, name, made_of)
    if (cached := _read(path, shape)) is not None:
        return cached
    found = np.ascontiguousarray(find(), dtype=np.float64)
    with suppress(OSError):
        write_hashed(path, found.tobytes())
    return found


def is_cached(module: str, name: str, made_of: Iterable[npt.NDArray[np.generic]], shape: tuple[int, ...]) -> bool:
    """Whether `cached_array` would return a cached array."""
    return _read(_cache_file(module, name, made_of), shape) is not None


def _cache_file(module: str, name: str, made_of: Iterable[npt.NDArray[np.generic]]) -> Path:
    return results_folder(module) / f"{name}-{_digest(made_of).hex()}.kept"


def _read(path: Path, shape: tuple[int, ...]) -> Array | None:
    content = read_hashed(path)
    if content is None:
        return None
    rows, rest = divmod(len(content), 8 * int(np.prod(shape[1:])))
    return None if rest or shape[0] not in (-1, rows) else np.frombuffer(content).reshape(shape).copy()


def _digest(arrays: Iterable[npt.NDArray[np.generic]]) -> bytes:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
