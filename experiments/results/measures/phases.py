"""Summaries of the two parts of a run on a curve that is bent: editing and performance."""

from dataclasses import dataclass
from typing import Literal, cast

from experiments.results.measures.summary_parts import AnimationSummary, FigureSummary, PathSummary, PushSummary
from sim.recording.recording import Recording

PressKind = Literal["held", "pushed", "undo", "redo", "nothing"]


@dataclass(frozen=True)
class PressSummary:
    """What the hand did between pressing the switch and releasing it.

    Attributes
    ----------
    start, seconds : float
        [s]
    what : {"held", "pushed", "undo", "redo", "nothing"}
        Whether the curve was held and dragged, its tube was pushed from outside, or a click undid or redid an edit.
    lap : float or None
        Phase of the grabbed point φ(t_j) or of the pushed point, as a share of the curve.
    dragged_mm : float
        Distance by which that point moved during the press, accurate to the motion of one tick.
    deviation_mm : float
        Distance of that point, at the end of the press, from the point of the same phase on the unedited curve.
    peak_force : float
        Largest force of the hand [N].
    """

    start: float
    seconds: float
    what: PressKind
    lap: float | None
    dragged_mm: float
    deviation_mm: float
    peak_force: float

    def line(self) -> str:
        """The press in words."""
        where = "" if self.lap is None else f" at {100.0 * self.lap:.0f} % of the curve"
        return {
            "held": f"grabbed{where} and dragged {self.dragged_mm:.1f} mm",
            "pushed": f"pushed{where} by {self.dragged_mm:.1f} mm from outside",
            "undo": "undone",
            "redo": "redone",
            "nothing": "pressed without effect",
        }[self.what]


@dataclass(frozen=True)
class EditingSummary:
    """The part of a run in which the curve can be bent.

    Attributes
    ----------
    seconds : float
        Duration from the start of the run [s].
    until : float or None
        Time from which the curve is to be performed [s]; None if it is not.
    presses : tuple of PressSummary
    pushes : tuple of PushSummary
        Pushes, while the hand neither reaches for the curve nor holds or carries it.
    animation : AnimationSummary or None
        Difference from the animation at the same phase of the unedited curve.
    figure : FigureSummary or None
    """

    seconds: float
    until: float | None
    presses: tuple[PressSummary, ...]
    pushes: tuple[PushSummary, ...]
    animation: AnimationSummary | None
    figure: FigureSummary | None

    def lines(self) -> list[str]:
        """What happened, a sentence or two."""
        done = "; ".join(f"at {press.start:.1f} s {press.line()}" for press in self.presses)
        shown, changes = self.animation, list[str]()
        if shown is not None:
            by = shown.changed(False, 1)
            changes = (
                [f"While it was edited the animation changed by up to {by}{_residual(self.figure)}."] if by else []
            )
        return [
            f"Editing, {self.seconds:.1f} s: {done or 'the switch was not pressed'}.",
            *pushes_line(self.pushes),
            *changes,
            *(
                []
                if self.until is None or self.seconds >= self.until
                else [f"It was to be performed from {self.until:.1f} s on, but the run ended before."]
            ),
        ]


@dataclass(frozen=True)
class PerformanceSummary:
    """The part of a run in which the bent curve is performed.

    Attributes
    ----------
    start, seconds : float
        [s]
    path : PathSummary
        How the stylus followed the bent curve.
    animation : AnimationSummary or None
        Difference from the animation at the same phase of the unedited curve.
    figure : FigureSummary or None
    """

    start: float
    seconds: float
    path: PathSummary
    animation: AnimationSummary | None
    figure: FigureSummary | None

    def lines(self) -> list[str]:
        """What happened, a sentence or two."""
        shown, changes = self.animation, list[str]()
        if shown is not None:
            by = shown.changed(bool(self.path.pushes), 1)
            differs = f"The performed animation differs from the unedited one by up to {by}{_residual(self.figure)}."
            changes = [differs] if by else []
        return [
            f"Performing, {self.seconds:.1f} s from {self.start:.1f} s on: {self.path.laps:.2f} laps, "
            f"{self.path.left_alone('the bent curve')}.",
            *pushes_line(self.path.pushes),
            *changes,
        ]


def pushes_line(pushes: tuple[PushSummary, ...]) -> list[str]:
    """The pushes in words; empty if there were none."""
    return [f"Pushes: {'; '.join(push.line() for push in pushes)}."] if pushes else []


def _residual(figure: FigureSummary | None) -> str:
    """The residual in words; falls are reported once, for the whole run."""
    return "" if figure is None else f"; residual force {100 * figure.residual_force_rms:.1f} % of body weight RMS"


def performance_start(recording: Recording) -> float | None:
    """Time from which a bent curve is performed [s]; None if it is not, or the run was interrupted."""
    performance = (recording.summary or {}).get("performance")
    return float(cast(dict[str, float], performance)["start"]) if isinstance(performance, dict) else None
