"""Changes of river in a run: when one took the hand that another had, in the summary and in the figures."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.recording import Recording

Array = npt.NDArray[np.float64]

ROWS = 100_000  # of the recording, read at a time


class RiverChange(NamedTuple):
    """One change of river.

    Attributes
    ----------
    t : float
        Time of the first tick at which the new river has the hand [s].
    before, after : str
        Names of the rivers.
    """

    t: float
    before: str
    after: str

    def line(self) -> str:
        """The change in words."""
        return f"t = {self.t:.2f} s: {self.before} → {self.after}"


def river_changes(recording: Recording) -> tuple[RiverChange, ...]:
    """All changes of a run, in memory that does not grow with it; none where the field has no rivers to tell apart.

    A river that has the hand again after none had it is no change; the first to have it is none either.
    """
    if "river_names" not in recording.texts:
        return ()
    names = recording.texts["river_names"].split("\n")
    t, river = recording.channel("ticks", "t"), recording.channel("ticks", "river")
    changes: list[RiverChange] = []
    last = -1.0
    for first in range(0, len(t), ROWS):
        rows = river[first : first + ROWS]
        held = np.flatnonzero(rows >= 0.0)
        before = np.concatenate(([last], rows[held][:-1])) if len(held) else np.zeros(0)
        for k in np.flatnonzero((rows[held] != before) & (before >= 0.0)):
            moment = float(t[first + int(held[k])])
            changes.append(RiverChange(moment, names[int(before[k])], names[int(rows[held[k]])]))
        last = float(rows[held[-1]]) if len(held) else last
    return tuple(changes)
