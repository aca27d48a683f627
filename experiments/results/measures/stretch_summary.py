"""Summary of how a curve was bent in a run, from the field's memory."""

from dataclasses import dataclass

import numpy as np

from controllers.fields.stretchy_tubes import StretchyTubes
from geometry.arrays import Array


@dataclass(frozen=True)
class StretchSummary:
    """How a curve was bent.

    Attributes
    ----------
    edits : int
        Number of edits in force at the end, without those undone.
    largest_mm : float
        Largest displacement of a point of the curve.
    changed : float
        Share of the curve's phases at which the curve is displaced.
    held_off_m : float
        Largest distance of a held point from the stylus.
    length_before_mm, length_after_mm : float
    reach_mm : float
        Radius up to which the bent curve's nearest point is unique (an estimate; see `Trajectory.reach`).
    """

    edits: int
    largest_mm: float
    changed: float
    held_off_m: float
    length_before_mm: float
    length_after_mm: float
    reach_mm: float

    def line(self) -> str:
        """Summary in a sentence."""
        if self.edits == 0:
            return "The curve was not bent."
        times = "once" if self.edits == 1 else f"{self.edits} times"
        return (
            f"The curve was bent {times}, by up to {self.largest_mm:.1f} mm over {100 * self.changed:.0f} % of it; "
            f"the held point was at the stylus within {self.held_off_m:.0e} m."
        )


def stretch_summary(tubes: StretchyTubes, memory: Array) -> StretchSummary:
    """Compare the bent curve in the field's memory with the unedited curve."""
    bent, phases = tubes.edited(memory), np.linspace(tubes.curve.start, tubes.curve.end, 2001)
    moved = np.linalg.norm(bent.point(phases) - tubes.curve.point(phases), axis=1)
    return StretchSummary(
        edits=len(tubes.edits(memory)),
        largest_mm=1e3 * float(moved.max()),
        changed=float(np.mean(moved > 1e-9)),
        held_off_m=tubes.held_off(memory),
        length_before_mm=1e3 * tubes.curve.length,
        length_after_mm=1e3 * bent.length,
        reach_mm=1e3 * bent.reach,
    )
