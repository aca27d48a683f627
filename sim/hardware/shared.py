"""Memory that processes share: numbers behind a sequence lock, and a ring of rows. Neither makes its writer wait.

Numbers of eight bytes are written whole, and stores are seen in the order in which they are made, on x86; elsewhere a
lock of this kind needs barriers that Python does not have.
"""

import math
from multiprocessing.shared_memory import SharedMemory
from typing import Self, cast

import numpy as np

from controllers.state import Array

_TRIES = 20  # so a writer that was stopped in the middle costs its reader microseconds


class _Shared:
    """Memory of a whole number and an array; a process may end without closing it.

    Parameters
    ----------
    shape : tuple of int
        Of the array.
    name : str, optional
        Of memory that is there; by default it is made.
    """

    def __init__(self, shape: tuple[int, ...], name: str | None):
        self._memory = SharedMemory(name, create=name is None, size=8 * (math.prod(shape) + 1))
        self._owner = name is None
        # An item of a memoryview is one of Python's numbers, with no array made.
        self._count = cast("memoryview[int]", self._memory.buf)[:8].cast("q")
        self._numbers: Array = np.ndarray(shape, np.float64, self._memory.buf, 8)
        if self._owner:
            self._count[0] = 0
            self._numbers[:] = 0.0

    def close(self) -> None:
        """Let the memory go; who made it removes it."""
        self._unmap()
        if self._owner:
            self._memory.unlink()

    def __del__(self) -> None:
        if hasattr(self, "_numbers"):
            self._unmap()

    def _unmap(self) -> None:
        # Memory cannot be given back while there are views into it.
        self._count.release()
        self._numbers = np.zeros(0)
        self._memory.close()


class SharedNumbers(_Shared):
    """Numbers that one process writes and others read, never half of one writing and half of the next.

    A sequence lock: the writer counts up to an odd number, writes, and counts up to an even one; a reader that sees an
    odd number, or another one after than before, reads again (Lameter, "Effective synchronization on Linux/NUMA
    systems", 2005). May be sent to another process as an argument of it.

    Parameters
    ----------
    size : int
        How many.
    name : str, optional
        Of memory that is there; by default it is made.
    """

    def __init__(self, size: int, name: str | None = None):
        super().__init__((size,), name)
        self._size, self._whole = size, np.zeros(size)

    def __reduce__(self) -> tuple[type[Self], tuple[int, str]]:
        return type(self), (self._size, self._memory.name)

    def write(self, numbers: Array) -> None:
        """Write all of them, shape (size,)."""
        self._count[0] += 1
        self._numbers[:] = numbers
        self._count[0] += 1

    def read(self, into: Array) -> bool:
        """Read all of them, shape (size,); False, and nothing, if a writer was stopped in the middle of them."""
        for _ in range(_TRIES):
            before = self._count[0]
            self._whole[:] = self._numbers
            if before % 2 == 0 and before == self._count[0]:
                into[:] = self._whole
                return True
        return False


class Ring(_Shared):
    """Rows that one process appends and another takes; a reader that does not keep up loses the oldest.

    Parameters
    ----------
    rows, width : int
        How many rows there is room for, and numbers in each.
    name : str, optional
        As in `SharedNumbers`.
    """

    def __init__(self, rows: int, width: int, name: str | None = None):
        super().__init__((rows, width), name)
        self._shape, self._taken = (rows, width), 0

    def __reduce__(self) -> tuple[type[Self], tuple[int, int, str]]:
        return type(self), (*self._shape, self._memory.name)

    def append(self, row: Array) -> None:
        """Append a row, shape (width,), and count it only then."""
        self._numbers[self._count[0] % self._shape[0]] = row
        self._count[0] += 1

    def take(self) -> tuple[Array, int]:
        """What has been appended since the last call.

        Returns
        -------
        rows : Array
            Shape (n, width).
        lost : int
            Rows before them that were overwritten.
        """
        rows, first, count = self._shape[0], self._taken, self._count[0]
        begin = max(first, count - rows + 1)
        taken = self._numbers[np.arange(begin, count) % rows]
        # What was written over meanwhile: the row that is being written, and those before it.
        sound = max(begin, self._count[0] - rows + 1)
        self._taken = count
        return taken[min(sound, count) - begin :], min(sound, count) - first
