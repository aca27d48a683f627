"""Numbers that two processes share: one writes, the other reads the newest whole set of them, and neither waits."""

import itertools
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from controllers.state import Array

_PATIENCE = 1.0  # [s] no writing lasts longer


class Board:
    """Named rows of numbers in shared memory, with one writer.

    A sequence number is odd while they are written; a reader tries again where it was, or has changed meanwhile
    (Lamport 1977, "Concurrent reading and writing").

    Parameters
    ----------
    memory : ctypes array of double
        Of `Board.memory`.
    sizes : Mapping
        How many numbers each name has.
    """

    def __init__(self, memory: Any, sizes: Mapping[str, int]):
        self._all: Array = np.frombuffer(memory, dtype=np.float64)
        starts = itertools.accumulate(sizes.values(), initial=1)
        self.rows = {name: self._all[a : a + n] for (name, n), a in zip(sizes.items(), starts, strict=False)}

    @staticmethod
    def memory(sizes: Mapping[str, int]) -> Any:
        """Memory for a board, to be handed to a process when it is started."""
        from multiprocessing import get_context

        return get_context("spawn").RawArray("d", 1 + sum(sizes.values()))

    @property
    def sequence(self) -> int:
        """Changes with every writing."""
        return int(self._all[0])

    def write(self, values: Mapping[str, npt.ArrayLike]) -> None:
        """Write some rows; one that is shorter than its place leaves the rest as it was."""
        self._all[0] += 1.0
        for name, value in values.items():
            row = np.ravel(np.asarray(value, dtype=np.float64))
            self.rows[name][: len(row)] = row
        self._all[0] += 1.0

    def read(self) -> dict[str, Array]:
        """A copy of all rows as they were written together; as they are, if the writer ended in the middle of it."""
        end = time.monotonic() + _PATIENCE
        while True:
            before = self._all[0]
            found = {name: row.copy() for name, row in self.rows.items()}
            if (before % 2.0 == 0.0 and before == self._all[0]) or time.monotonic() > end:
                return found
            time.sleep(0.0)
