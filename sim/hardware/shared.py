"""Memory that processes share: numbers behind a sequence lock, and a ring of rows. Neither makes its writer wait."""

import math
from multiprocessing.shared_memory import SharedMemory
from typing import Self

import numpy as np

from controllers.state import Array, IntArray
from sim.compilation.compiled import entry_point
from sim.compilation.sequence_lock import barrier, read_whole, write_whole


@entry_point
def append_row(count: IntArray, rows: Array, row: Array) -> None:
    """`Ring.append`."""
    place = count[0] % len(rows)
    for i in range(len(row)):
        rows[place, i] = row[i]
    barrier()
    count[0] += 1


class _Shared:
    """Memory of a whole number and an array; a process may end without closing it.

    `count` and `numbers` are those, for compiled code; who keeps them lets them go before the memory is closed.

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
        self.count: IntArray = np.ndarray(1, np.int64, self._memory.buf)
        self.numbers: Array = np.ndarray(shape, np.float64, self._memory.buf, 8)
        if self._owner:
            self.count[0] = 0
            self.numbers[:] = 0.0

    def close(self) -> None:
        """Let the memory go; who made it removes it."""
        self._unmap()
        if self._owner:
            self._memory.unlink()

    def __del__(self) -> None:
        if hasattr(self, "numbers"):
            self._unmap()

    def _unmap(self) -> None:
        # Memory cannot be given back while there are views into it.
        del self.count, self.numbers
        self._memory.close()


class SharedNumbers(_Shared):
    """Numbers that one process writes and others read, never half of one writing and half of the next.

    By a sequence lock: the writer counts up to an odd number, writes, and counts up to an even one; a reader that sees
    an odd number, or another one after than before, reads again. May be sent to another process as an argument of it.

    Parameters
    ----------
    size : int
        How many.
    name : str, optional
        Of memory that is there; by default it is made.
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
        """Read all of them, shape (size,); False, and nothing, if a writer was stopped in the middle of them."""
        return read_whole(self.count, self.numbers, self.whole, into)


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
        append_row(self.count, self.numbers, row)

    def take(self) -> tuple[Array, int]:
        """What has been appended since the last call.

        Returns
        -------
        rows : Array
            Shape (n, width).
        lost : int
            Rows before them that were overwritten.
        """
        rows, first, count = self._shape[0], self._taken, int(self.count[0])
        begin = max(first, count - rows + 1)
        taken = self.numbers[np.arange(begin, count) % rows]
        # What was written over meanwhile: the row that is being written, and those before it.
        sound = max(begin, int(self.count[0]) - rows + 1)
        self._taken = count
        return taken[min(sound, count) - begin :], min(sound, count) - first
