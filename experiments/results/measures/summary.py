"""Summary of a run, as numbers and in words."""

from dataclasses import dataclass

from experiments.results.measures.arm_summary import ArmSummary
from experiments.results.measures.changes import RiverChange
from experiments.results.measures.lead_measures import LeadSummary
from experiments.results.measures.oscillation import OscillationSummary
from experiments.results.measures.phases import EditingSummary, PerformanceSummary
from experiments.results.measures.stretch_summary import StretchSummary
from experiments.results.measures.summary_parts import (
    AnimationSummary,
    FigureSummary,
    PathSummary,
    ReplaySummary,
    SpeedSummary,
    TankSummary,
    TraceSummary,
)


@dataclass(frozen=True)
class RunSummary:
    """The whole summary of a run, as in summary.json; `lines` gives what was measured in words.

    Attributes
    ----------
    path, animation, figure, tank, speed
        Measures of the whole run. `animation` is None in a run without a figure, `figure` None without a physical one.
    warnings : dict of str to int
        Number of MuJoCo's warnings, by name.
    faults : tuple of str
        Faults of the device, a sentence each.
    stretch : StretchSummary or None
        How the curve was bent, in the modes that bend one.
    changes : tuple of RiverChange
        Changes from one river to another.
    lead : LeadSummary or None
        How the figure was led, in LEADING.
    editing, performance : EditingSummary, PerformanceSummary or None
        In the modes that bend a curve, the part of the run in which it was bent, and that in which it was performed.
    trace : TraceSummary, ReplaySummary or None
        How the hand moved by itself, or as it was recorded, if it did.
    oscillation : OscillationSummary or None
        Measured stability of the loop.
    arm : ArmSummary or None
        How a robot arm followed the stylus, if one did.
    remarks : tuple of str
        What was said before the run: what its clips and its map are not suited for, and what was chosen instead.
    """

    path: PathSummary
    animation: AnimationSummary | None
    figure: FigureSummary | None
    tank: TankSummary
    speed: SpeedSummary
    warnings: dict[str, int]
    faults: tuple[str, ...] = ()
    stretch: StretchSummary | None = None
    changes: tuple[RiverChange, ...] = ()
    lead: LeadSummary | None = None
    editing: EditingSummary | None = None
    performance: PerformanceSummary | None = None
    trace: TraceSummary | ReplaySummary | None = None
    oscillation: OscillationSummary | None = None
    arm: ArmSummary | None = None
    remarks: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Summary in words, one sentence per line."""
        figure = self.figure
        warnings_text = ", ".join(f"{name} ×{count}" for name, count in self.warnings.items()) or "none"
        bent = [] if self.stretch is None else [self.stretch.line()]
        changed = [f"Rivers: {'; '.join(change.line() for change in self.changes)}."] if self.changes else []
        held = f"The energy tank reduced the force at {self.tank.scaled_ticks} ticks."
        return [
            *self.faults,
            *([fall_line] if figure is not None and (fall_line := figure.fall_line()) else []),
            *([] if self.oscillation is None else self.oscillation.lines()),
            *bent,
            *changed,
            *([held] if self.tank.scaled_ticks else []),
            *self._hand_lines(),
            *([pace_line] if (pace_line := self.path.line(self.animation is not None)) else []),
            *([] if self.animation is None else [self.animation.soles()]),
            *([] if figure is None else figure.lines()),
            *([] if self.arm is None else self.arm.lines()),
            f"It ran at {self.speed.real_time_factor:.2f} × real time with {self.speed.peak_memory_mb:.0f} MB; "
            f"MuJoCo's warnings: {warnings_text}.",
        ]

    def _hand_lines(self) -> list[str]:
        """Sentences on stylus and animation, by kind of run: LEADING, a bent curve, or any other."""
        replayed = [self.trace.line()] if isinstance(self.trace, ReplaySummary) else []
        if self.lead is not None:
            return [*replayed, *self.lead.lines()]
        if self.editing is not None:
            return [*replayed, *self.editing.lines(), *([] if self.performance is None else self.performance.lines())]
        path, animation = self.path, self.animation
        ran = f"The stylus ran {path.laps:.2f} laps, {path.left_alone('the curve')}."
        pushes = "; ".join(push.line() for push in path.pushes)
        worked = self.trace.line() if self.trace else f"Pushes: {pushes}." if pushes else "The hand did not push."
        if animation is None:
            return [ran, worked]
        by = animation.changed(bool(pushes), 2)
        changes = [f"The animation changed by up to {by}."] if by else []
        return [ran, worked, *changes]
