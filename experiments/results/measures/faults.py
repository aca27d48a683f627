"""Faults of a device in a run: kind, time and value."""

import numpy as np

from controllers.safety.faults import Fault, LatchedFault
from experiments.results.measures.blocks import ROWS
from sim.recording.recording import Recording


def fault_lines(recording: Recording) -> tuple[str, ...]:
    """A line for each latched fault, in order of time, and one for the ticks that came late."""
    ticks = recording.groups["ticks"]
    if "fault" not in ticks:
        return ()
    lines: list[str] = []
    before, gaps = 0.0, 0
    for first in range(0, len(ticks["t"]), ROWS):
        rows = slice(first, first + ROWS)
        codes, gaps = ticks["fault"][rows], int(ticks["gaps"][rows][-1])
        changes = np.flatnonzero(np.diff(codes, prepend=before) != 0.0)
        for row in changes[codes[changes] != 0.0]:
            t, value = float(ticks["t"][rows][row]), float(ticks["fault_value"][rows][row])
            lines.append(LatchedFault(Fault(int(codes[row])), t, value).line())
        before = float(codes[-1])
    if gaps:
        lines.append(f"The servo was late {gaps} times; the force was released and ramped in again.")
    return tuple(lines)
