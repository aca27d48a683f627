"""Changes of river in a run, for the summary and the figures: when the hand passed from one river to another."""

from typing import NamedTuple

import numpy as np

from experiments.results.measures.blocks import ROWS
from sim.recording.recording import Recording
from sim.reference.transition import DWELL_TIME

LOST = "no river until the end"
_LOST_TIME = 1.0  # [s] in no river at the end of a run from which the hand counts as lost


class RiverChange(NamedTuple):
    """One change of river.

    Attributes
    ----------
    t : float
        Time of the first tick at which the hand is in the new river [s].
    before, after : str
        Names of the rivers; `LOST` after the last one if no river has the hand until the end.
    """

    t: float
    before: str
    after: str

    def line(self) -> str:
        """The change in words."""
        return f"t = {self.t:.2f} s: {self.before} → {self.after}"


def river_changes(recording: Recording) -> tuple[RiverChange, ...]:
    """All changes of river in a run, in constant memory; none if the field has no named rivers.

    Not counted are the first river, a return to the same river after the hand was in none, and a stay that is shorter
    than `sim.reference.transition.DWELL_TIME`, which a river's clip needs to be played.
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
            # Row −1: the river at the end of the previous block continues.
            if k >= 0:
                current, since = float(rows[k]), float(times[k])
            lasted = float(times[end] if end < len(rows) else times[-1]) - since
            if current < 0.0 or current == last or lasted < DWELL_TIME:
                continue
            if last >= 0.0:
                changes.append(RiverChange(since, names[int(last)], names[int(current)]))
            last = current
    if last >= 0.0 > current and float(t[len(t) - 1]) - since >= _LOST_TIME:
        changes.append(RiverChange(since, names[int(last)], LOST))
    return tuple(changes)
