"""What happened in a run, in numbers and in a few lines."""

from dataclasses import dataclass

from experiments.results.changes import RiverChange
from experiments.results.lead_measures import LeadSummary
from experiments.results.phases import EditingSummary, PerformanceSummary
from experiments.results.stretch_summary import StretchSummary
from experiments.results.summary_parts import (
    AnimationSummary,
    FaultSummary,
    FigureSummary,
    PathSummary,
    SpeedSummary,
    TankSummary,
    TraceSummary,
)


@dataclass(frozen=True)
class RunSummary:
    """All of it, as summary.json has it; `lines` says it in a few sentences.

    Attributes
    ----------
    path, animation, figure, tank, speed
        Of the whole run; without a figure there is no animation, and of one that is only shown nothing of its physics.
    warnings : dict of str to int
        MuJoCo's, and how often.
    stretch : StretchSummary or None
        How the curve was bent, in the modes that bend one.
    editing, performance : EditingSummary, PerformanceSummary or None
        In these modes, the part of the run in which it was bent, and the part in which it was performed.
    changes : tuple of RiverChange
        Where rivers give the hand to one another.
    lead : LeadSummary or None
        Where a figure was led.
    trace : TraceSummary or None
        Where the hand traced the curve by itself.
    fault : FaultSummary or None
        What made the device let go, if anything did.
    """

    path: PathSummary
    animation: AnimationSummary | None
    figure: FigureSummary | None
    tank: TankSummary
    speed: SpeedSummary
    warnings: dict[str, int]
    stretch: StretchSummary | None = None
    changes: tuple[RiverChange, ...] = ()
    lead: LeadSummary | None = None
    editing: EditingSummary | None = None
    performance: PerformanceSummary | None = None
    trace: TraceSummary | None = None
    fault: FaultSummary | None = None

    @property
    def fell_at(self) -> float | None:
        """When the physical figure fell [s]; None if it did not, or there is none."""
        return None if self.figure is None else self.figure.fell_at

    def lines(self) -> list[str]:
        """What happened, a sentence each."""
        warned = ", ".join(f"{name} ×{count}" for name, count in self.warnings.items()) or "none"
        bent = [] if self.stretch is None else [self.stretch.line()]
        changed = [f"Rivers: {'; '.join(change.line() for change in self.changes)}."] if self.changes else []
        held = f"The energy tank held the field back at {self.tank.scaled_ticks} ticks."
        return [
            *([] if self.fault is None else self.fault.lines()),
            *bent,
            *changed,
            *([held] if self.tank.scaled_ticks else []),
            *self._of_the_hand(),
            *self._of_the_figure(),
            f"It ran at {self.speed.real_time_factor:.2f} × real time with {self.speed.peak_memory_mb:.0f} MB; "
            f"MuJoCo's warnings: {warned}.",
        ]

    def _of_the_figure(self) -> list[str]:
        """How a physical figure followed."""
        figure = self.figure
        if figure is None:
            return []
        return [
            ("" if figure.fell_at is None else f"The physical figure fell at {figure.fell_at:.1f} s. Until then: ")
            + f"The physical figure followed within {figure.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{figure.root_error_rms_cm:.2f} cm at the root; residual force {100 * figure.residual_force_rms:.1f} % "
            f"of body weight RMS, feet on the ground {100 * figure.grounded:.0f} % of stance."
        ]

    def _of_the_hand(self) -> list[str]:
        """How stylus and animation went: of a figure that was led, of a curve that was bent, or of neither."""
        if self.lead is not None:
            return self.lead.lines()
        if self.editing is not None:
            return [*self.editing.lines(), *([] if self.performance is None else self.performance.lines())]
        path, animation = self.path, self.animation
        alone = path.deviation_rms_mm
        left = "never left alone" if alone is None else f"{alone:.2f} mm RMS from the curve when left alone"
        pushes = "; ".join(push.line() for push in path.pushes)
        worked = self.trace.line() if self.trace else f"Pushes: {pushes}." if pushes else "The hand did not push."
        ran = [f"The stylus ran {path.laps:.2f} laps, {left}.", worked]
        if animation is None:
            return ran
        by = f"{max(animation.pushed_deg, animation.unpushed_deg):.2f}° a joint"
        if pushes:
            by = f"{animation.pushed_deg:.1f}° a joint where it was pushed, {animation.unpushed_deg:.2f}° elsewhere"
        return [*ran, f"The animation changed by up to {by}."]
