"""Shared memory between processes: numbers under a sequence lock, and a ring of rows; the writer never waits."""

import math
from multiprocessing.shared_memory import SharedMemory
from typing import Self

import numpy as np

from geometry.arrays import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.compilation.sequence_lock import barrier, read_whole, write_whole


@entry_point
def append_row(count: IntArray, rows: Array, row: Array) -> None:
    """Compiled `Ring.append`."""
    index = count[0] % len(rows)
    for i in range(len(row)):
        rows[index, i] = row[i]
    barrier()
    count[0] += 1


class _SharedArray:
    """Shared memory of an integer, `count`, and an array, `numbers`; a process may end without closing it.

    Other references to `count` and `numbers` must be dropped before the memory is closed.

    Parameters
    ----------
    shape : tuple of int
        Shape of the array.
    name : str, optional
        Name of existing shared memory; by default new memory is created.
    """

    def __init__(self, shape: tuple[int, ...], name: str | None):
        self._memory = SharedMemory(name, create=name is None, size=8 * (math.prod(shape) + 1))
        self._is_owner = name is None
        self.count: IntArray = np.ndarray(1, np.int64, self._memory.buf)
        self.numbers: Array = np.ndarray(shape, np.float64, self._memory.buf, 8)
        if self._is_owner:
            self.count[0] = 0
            self.numbers[:] = 0.0

    def close(self) -> None:
        """Unmap the memory; the object that created it also removes it."""
        self._unmap()
        if self._is_owner:
            self._memory.unlink()

    def __del__(self) -> None:
        if hasattr(self, "numbers"):
            self._unmap()

    def _unmap(self) -> None:
        # Shared memory cannot be closed while there are views of it.
        del self.count, self.numbers
        self._memory.close()


class SharedNumbers(_SharedArray):
    """Numbers that one process writes and others read, always consistently.

    By a sequence lock: the writer increments the count to an odd number, writes, and increments it to an even one; a
    reader that sees an odd count, or a count that changed while it read, reads again. May be passed to another process
    as an argument.

    Parameters
    ----------
    size : int
        Number of numbers.
    name : str, optional
        Name of existing shared memory; by default new memory is created.
    """

    def __init__(self, size: int, name: str | None = None):
        super().__init__((size,), name)
        self._size, self.whole = size, np.zeros(size)

    def __reduce__(self) -> tuple[type[Self], tuple[int, str]]:
        return type(self), (self._size, self._memory.name)

    def write(self, numbers: Array) -> None:
        """Write all of them, shape (size,)."""
        write_whole(self.count, self.numbers, numbers)

    def read(self, into: Array) -> bool:
        """Read all of them, shape (size,); False, with `into` unchanged, if a writer stopped while writing."""
        return read_whole(self.count, self.numbers, self.whole, into)


class Ring(_SharedArray):
    """A ring buffer of rows that one process appends and another takes; a slow reader loses the oldest rows.

    Parameters
    ----------
    rows, width : int
        Capacity in rows, and numbers per row.
    name : str, optional
        As in `SharedNumbers`.
    """

    def __init__(self, rows: int, width: int, name: str | None = None):
        super().__init__((rows, width), name)
        self._shape, self._taken_count = (rows, width), 0

    def __reduce__(self) -> tuple[type[Self], tuple[int, int, str]]:
        return type(self), (*self._shape, self._memory.name)

    def append(self, row: Array) -> None:
        """Append a row, shape (width,); the count is raised after the row is written."""
        append_row(self.count, self.numbers, row)

    def take(self) -> tuple[Array, int]:
        """Take the rows appended since the last call.

        Returns
        -------
        rows : Array
            Shape (n, width).
        lost : int
            Number of rows before them that were overwritten.
        """
        rows, taken_count, count = self._shape[0], self._taken_count, int(self.count[0])
        begin = max(taken_count, count - rows + 1)
        taken = self.numbers[np.arange(begin, count) % rows]
        # Drop rows overwritten during the copy, including the one being written now.
        first_valid = max(begin, int(self.count[0]) - rows + 1)
        self._taken_count = count
        return taken[min(first_valid, count) - begin :], min(first_valid, count) - taken_count
