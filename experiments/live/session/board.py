"""Shared memory between two processes: one writes a set of numbers, the other reads the latest complete set."""

import itertools
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array

_MAX_RETRY_TIME = 1.0  # [s] of a reader; a write is much shorter


class Board:
    """Named rows of numbers in shared memory, with one writer.

    A sequence lock: the sequence number is odd during a write, and a reader retries if the number was odd or
    changed during the read (Lamport 1977, "Concurrent reading and writing").

    Parameters
    ----------
    memory : ctypes array of double
        Memory from `Board.memory`.
    sizes : Mapping
        Number of values of each row, by name.
    """

    def __init__(self, memory: Any, sizes: Mapping[str, int]):
        self._values: Array = np.frombuffer(memory, dtype=np.float64)
        starts = itertools.accumulate(sizes.values(), initial=1)
        self.rows = {name: self._values[a : a + n] for (name, n), a in zip(sizes.items(), starts, strict=False)}

    @staticmethod
    def memory(sizes: Mapping[str, int]) -> Any:
        """Memory for a board, to be passed to a process when it is started."""
        from multiprocessing import get_context

        return get_context("spawn").RawArray("d", 1 + sum(sizes.values()))

    @property
    def sequence(self) -> int:
        """Sequence number, which changes with every write."""
        return int(self._values[0])

    def write(self, values: Mapping[str, npt.ArrayLike]) -> None:
        """Write some rows; a value shorter than its row leaves the rest of the row unchanged."""
        self._values[0] += 1.0
        for name, value in values.items():
            row = np.ravel(np.asarray(value, dtype=np.float64))
            self.rows[name][: len(row)] = row
        self._values[0] += 1.0

    def read(self) -> dict[str, Array]:
        """A consistent copy of all rows; if the writer died during a write, the rows as they are."""
        end = time.monotonic() + _MAX_RETRY_TIME
        while True:
            before = self._values[0]
            rows = {name: row.copy() for name, row in self.rows.items()}
            if (before % 2.0 == 0.0 and before == self._values[0]) or time.monotonic() > end:
                return rows
            time.sleep(0.0)
