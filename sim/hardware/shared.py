"""Memory that processes share: numbers behind a sequence lock, and a ring of rows. Neither makes its writer wait.

Numbers of eight bytes are written whole, and stores are seen in the order in which they are made, on x86; elsewhere a
lock of this kind needs barriers that Python does not have.
"""

from multiprocessing.shared_memory import SharedMemory
from typing import Self, cast

import numpy as np

from controllers.state import Array

_TRIES = 20  # so a writer that was stopped in the middle costs its reader microseconds


def _counter(memory: SharedMemory) -> "memoryview[int]":
    """The whole number that the memory begins with; an item of a memoryview is one of Python's, with no array made."""
    return cast("memoryview[int]", memory.buf)[:8].cast("q")


class SharedNumbers:
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
        self._memory = SharedMemory(name, create=name is None, size=8 * (size + 1))
        self._size, self._owner = size, name is None
        self._sequence = _counter(self._memory)
        self._numbers, self._whole = np.ndarray(size, np.float64, self._memory.buf, 8), np.zeros(size)
        if self._owner:
            self._sequence[0] = 0
            self._numbers[:] = 0.0

    def __reduce__(self) -> tuple[type[Self], tuple[int, str]]:
        return type(self), (self._size, self._memory.name)

    def write(self, numbers: Array) -> None:
        """Write all of them, shape (size,)."""
        self._sequence[0] += 1
        self._numbers[:] = numbers
        self._sequence[0] += 1

    def read(self, into: Array) -> bool:
        """Read all of them, shape (size,); False, and nothing, if a writer was stopped in the middle of them."""
        for _ in range(_TRIES):
            before = self._sequence[0]
            self._whole[:] = self._numbers
            if before % 2 == 0 and before == self._sequence[0]:
                into[:] = self._whole
                return True
        return False

    def close(self) -> None:
        """Let the memory go; who made it removes it."""
        self._sequence.release()
        del self._numbers
        self._memory.close()
        if self._owner:
            self._memory.unlink()


class Ring:
    """Rows that one process appends and another takes; a reader that does not keep up loses the oldest.

    Parameters
    ----------
    rows, width : int
        How many rows there is room for, and numbers in each.
    name : str, optional
        As in `SharedNumbers`.
    """

    def __init__(self, rows: int, width: int, name: str | None = None):
        self._memory = SharedMemory(name, create=name is None, size=8 * (rows * width + 1))
        self._shape, self._owner = (rows, width), name is None
        self._count = _counter(self._memory)
        self._rows = np.ndarray((rows, width), np.float64, self._memory.buf, 8)
        self._taken = 0
        if self._owner:
            self._count[0] = 0

    def __reduce__(self) -> tuple[type[Self], tuple[int, int, str]]:
        return type(self), (*self._shape, self._memory.name)

    def append(self, row: Array) -> None:
        """Append a row, shape (width,), and count it only then."""
        self._rows[self._count[0] % self._shape[0]] = row
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
        taken = self._rows[np.arange(begin, count) % rows]
        # What was written over meanwhile: the row that is being written, and those before it.
        sound = max(begin, self._count[0] - rows + 1)
        self._taken = count
        return taken[min(sound, count) - begin :], min(sound, count) - first

    def close(self) -> None:
        """Let the memory go; who made it removes it."""
        self._count.release()
        del self._rows
        self._memory.close()
        if self._owner:
            self._memory.unlink()
