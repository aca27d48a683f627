"""What happened in a run, in numbers and in five lines."""

from dataclasses import dataclass

from experiments.changes import RiverChange
from experiments.lead_measures import LeadSummary
from experiments.stretch import StretchSummary


@dataclass(frozen=True)
class PushSummary:
    """One push: when, how hard, and how far the stylus went with it.

    Attributes
    ----------
    start, seconds : float
        [s]
    peak_force : float
        [N]
    deviation_mm : float
        Largest distance from the curve during the push.
    along_push : float
        Cosine between force and deviation where the deviation is largest: 1 if it followed the push.
    """

    start: float
    seconds: float
    peak_force: float
    deviation_mm: float
    along_push: float


@dataclass(frozen=True)
class PathSummary:
    """How the stylus followed the curve.

    Attributes
    ----------
    deviation_rms_mm, deviation_max_mm : float
        Distance from the curve after the first second, while and soon after pushes left out; the RMS is None if that
        leaves nothing.
    laps : float
        Laps of a closed curve, or times its length.
    lap_seconds : float or None
        Mean time of a lap; None before the first.
    pushes : tuple of PushSummary
    """

    deviation_rms_mm: float | None
    deviation_max_mm: float
    laps: float
    lap_seconds: float | None
    pushes: tuple[PushSummary, ...]


@dataclass(frozen=True)
class AnimationSummary:
    """How the animation changed.

    Attributes
    ----------
    pushed_deg, unpushed_deg : float
        Largest difference of a joint's rotation between h(p) and h at the curve's nearest point, while the hand pushes
        (and until the stylus is back) and otherwise; the first second left out.
    """

    pushed_deg: float
    unpushed_deg: float


@dataclass(frozen=True)
class TankSummary:
    """How much of its budget of energy the field needed.

    Attributes
    ----------
    least_mj : float
        Energy that the tank held at least [mJ].
    scaled_ticks : int
        Ticks at which it let less than the whole force through.
    """

    least_mj: float
    scaled_ticks: int


@dataclass(frozen=True)
class FigureSummary:
    """How the physical figure followed the animation, until it fell, if it did.

    Attributes
    ----------
    fell_at : float or None
        When its root was first half a metre from the animation's [s], if it was. What follows is of the time before.
    joint_error_rms_deg, root_error_rms_cm, root_error_max_cm : float
    residual_force_rms : float
        Residual force at the root while the reference is on the ground, as a share of body weight.
    residual_force_max : float
        Likewise, the largest.
    residual_moment_rms : float
        Moment over body weight × 1 m, likewise.
    residual_in_flight_max : float
        Largest residual force or moment while the reference flies [N, N m].
    flight_seconds : float
    saturated : float
        Share of the motors' time at their limit.
    grounded : float
        Share of the time in which the reference stands that the ground bears the figure.
    ground_force_mean : float
        Mean vertical ground force as a share of body weight.
    """

    fell_at: float | None
    joint_error_rms_deg: float
    root_error_rms_cm: float
    root_error_max_cm: float
    residual_force_rms: float
    residual_force_max: float
    residual_moment_rms: float
    residual_in_flight_max: float
    flight_seconds: float
    saturated: float
    grounded: float
    ground_force_mean: float


@dataclass(frozen=True)
class SpeedSummary:
    """What the run cost: simulated over real time, seconds until the first tick, and peak memory [MB]."""

    real_time_factor: float
    first_tick_seconds: float
    peak_memory_mb: float


@dataclass(frozen=True)
class RunSummary:
    """All of it; `lines` says it in five sentences, one more for a bent curve, changes of river, a tank that acted.

    Where a figure was led, two sentences tell of that instead of the curve.
    """

    path: PathSummary
    animation: AnimationSummary
    figure: FigureSummary
    tank: TankSummary
    speed: SpeedSummary
    warnings: dict[str, int]
    stretch: StretchSummary | None = None
    changes: tuple[RiverChange, ...] = ()
    lead: LeadSummary | None = None

    def lines(self) -> list[str]:
        """What happened, a sentence each."""
        path, figure = self.path, self.figure
        pushes = "; ".join(
            f"{push.peak_force:.1f} N at {push.start:.1f} s moved it {push.deviation_mm:.1f} mm" for push in path.pushes
        )
        warned = ", ".join(f"{name} ×{count}" for name, count in self.warnings.items()) or "none"
        bent = [] if self.stretch is None else [self.stretch.line()]
        changed = [f"Rivers: {'; '.join(change.line() for change in self.changes)}."] if self.changes else []
        held = f"The energy tank held the field back at {self.tank.scaled_ticks} ticks."
        pushed, elsewhere = f"{self.animation.pushed_deg:.1f}° a joint", f"{self.animation.unpushed_deg:.2f}°"
        changed_by = f"{pushed} where it was pushed, {elsewhere} elsewhere" if pushes else f"{elsewhere} a joint"
        alone = path.deviation_rms_mm
        left = "never left alone" if alone is None else f"{alone:.2f} mm RMS from the curve when left alone"
        on_curve = [
            f"The stylus ran {path.laps:.2f} laps, {left}.",
            f"Pushes: {pushes}." if pushes else "The hand did not push.",
            f"The animation changed by up to {changed_by}.",
        ]
        return [
            *bent,
            *changed,
            *([held] if self.tank.scaled_ticks else []),
            *(on_curve if self.lead is None else self.lead.lines()),
            ("" if figure.fell_at is None else f"The physical figure fell at {figure.fell_at:.1f} s. Until then: ")
            + f"The physical figure followed within {figure.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{figure.root_error_rms_cm:.2f} cm at the root; residual force {100 * figure.residual_force_rms:.1f} % "
            f"of body weight RMS, feet on the ground {100 * figure.grounded:.0f} % of stance.",
            f"It ran at {self.speed.real_time_factor:.2f} × real time with {self.speed.peak_memory_mb:.0f} MB; "
            f"MuJoCo's warnings: {warned}.",
        ]
