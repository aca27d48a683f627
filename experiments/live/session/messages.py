"""Messages between the page and the engine's process, and the shared boards of values that change continuously."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from experiments.config.run_config import RunConfig
from geometry.arrays import Array
from sim.hardware.shared import SharedNumbers
from sim.viewer.shown import COURSE_POINTS

SLICE_SIDE = 9  # points along each side of the field's slice

SHOWN = {
    "t": 1, "cost": 2, "pace": 1, "fault": 2, "bends": 1, "performs": 1, "recording": 1, "curve": 1, "qpos": 256,
    "ghost": 75, "reference": 75, "p": 3, "force": 3, "user": 3, "target": 3, "switch": 1, "distance": 1,
    "residual": 1, "course": 3 * COURSE_POINTS,
    "slice": 6 * SLICE_SIDE**2,
}  # fmt: skip
"""Rows of the engine's board, with their sizes: the displayed values; ``curve`` counts changes of ``course``;
``recording`` is 0 without a take, else one tick longer than the take, so that a take of a paused run is visible."""

HELD = {"grip": 1, "pressed": 1, "target": 3, "pace": 1, "paused": 1, "steps": 1, "slice": 1}
"""Rows of the page's board, with their sizes: grip, target and clock; ``steps`` counts the requested single steps."""


class Order(Enum):
    """Orders without content."""

    RESET = "return to the beginning"
    UNDO = "undo the last bend"
    REDO = "redo the last undone bend"
    REARM = "clear a latched fault"
    STOP = "end the take"
    QUIT = "end the process"


@dataclass(frozen=True)
class Build:
    """Build another run."""

    config: RunConfig


@dataclass(frozen=True)
class SetGains:
    """Apply the gains of a configuration."""

    config: RunConfig


@dataclass(frozen=True)
class GoBack:
    """Go back to the last stored state at or before a time [s]."""

    t: float


@dataclass(frozen=True)
class Perform:
    """Perform the bent curve, or bend it again."""

    now: bool


@dataclass(frozen=True)
class Record:
    """Begin a take in a folder."""

    folder: Path


@dataclass(frozen=True)
class Built:
    """A run has been built.

    Attributes
    ----------
    config : RunConfig
        Configuration with all defaults filled in.
    drawn : dict
        Curves, tubes and scene, as recordings store them (`Session.static`).
    bends : bool
        Whether its curve can be bent.
    remarks : tuple of str
        Remarks for the person.
    """

    config: RunConfig
    drawn: dict[str, Any]
    bends: bool
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Progress:
    """An operation in progress, and its completed share from 0 to 1."""

    text: str
    share: float


@dataclass(frozen=True)
class Refused:
    """The reason why an order was refused."""

    text: str


@dataclass(frozen=True)
class Saved:
    """A take was saved in its folder."""

    folder: Path


class Board:
    """Named rows of numbers in shared memory, with one writer; passed to another process as an argument.

    Parameters
    ----------
    sizes : Mapping
        Number of values of each row, by name.
    shared : SharedNumbers, optional
        Existing memory of these rows; by default new memory is created.

    Attributes
    ----------
    rows : dict of Array
        The rows as this process last wrote or read them.
    """

    def __init__(self, sizes: Mapping[str, int], shared: SharedNumbers | None = None):
        self._sizes, self._numbers = sizes, np.zeros(sum(sizes.values()))
        self._shared = shared or SharedNumbers(len(self._numbers))
        starts = itertools.accumulate(sizes.values(), initial=0)
        self.rows = {name: self._numbers[a : a + n] for (name, n), a in zip(sizes.items(), starts, strict=False)}

    def __reduce__(self) -> tuple[type[Self], tuple[Mapping[str, int], SharedNumbers]]:
        return type(self), (self._sizes, self._shared)

    def write(self, values: Mapping[str, npt.ArrayLike]) -> None:
        """Write some rows; a value shorter than its row leaves the rest of the row unchanged."""
        for name, value in values.items():
            row = np.ravel(np.asarray(value, dtype=np.float64))
            self.rows[name][: len(row)] = row
        self._shared.write(self._numbers)

    def read(self) -> dict[str, Array]:
        """A copy of all rows as they were written together."""
        self._shared.read(self._numbers)
        return {name: row.copy() for name, row in self.rows.items()}

    def close(self) -> None:
        """Unmap the memory; the board that created it also removes it."""
        self._shared.close()
