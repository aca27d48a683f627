"""Changes of river in a run: when one took the hand that another had, in the summary and in the figures."""

from typing import NamedTuple

import numpy as np

from sim.recording.recording import Recording
from sim.reference.transition import DWELL

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

    A river that has the hand again after none had it is no change; the first to have it is none either; nor one that
    has it for less than its clip would need to play (`sim.reference.transition.DWELL`).
    """
    if "river_names" not in recording.texts:
        return ()
    names = recording.texts["river_names"].split("\n")
    t, river = recording.channel("ticks", "t"), recording.channel("ticks", "river")
    changes: list[RiverChange] = []
    last = current = -1.0
    since = 0.0
    for first in range(0, len(t), ROWS):
        times, rows = t[first : first + ROWS], river[first : first + ROWS]
        edges = np.flatnonzero(np.diff(rows, prepend=current))
        for k, end in zip([-1, *edges], [*edges, len(rows)], strict=True):
            # Row −1: what the rows before have ended with goes on.
            if k >= 0:
                current, since = float(rows[k]), float(times[k])
            lasted = float(times[end] if end < len(rows) else times[-1]) - since
            if current < 0.0 or current == last or lasted < DWELL:
                continue
            if last >= 0.0:
                changes.append(RiverChange(since, names[int(last)], names[int(current)]))
            last = current
    return tuple(changes)
