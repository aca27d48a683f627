"""What is measured of a run: the stylus, the animation, the tank, the figure, the computer."""

from dataclasses import dataclass


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

    def line(self) -> str:
        """The push in words."""
        return f"{self.peak_force:.1f} N at {self.start:.1f} s moved it {self.deviation_mm:.1f} mm"


@dataclass(frozen=True)
class PathSummary:
    """How the stylus followed the curve, as it was bent if it was.

    Attributes
    ----------
    deviation_rms_mm, deviation_max_mm : float
        Distance from the curve after the first second, while and soon after the hand does something left out; the RMS
        is None if that leaves nothing.
    laps : float
        Laps of a closed curve, or times its length.
    lap_seconds : float or None
        Mean time of a lap; None before the first.
    pushes : tuple of PushSummary
        A hand that grabs, traces or leads does not push.
    """

    deviation_rms_mm: float | None
    deviation_max_mm: float
    laps: float
    lap_seconds: float | None
    pushes: tuple[PushSummary, ...]

    @property
    def deviation_rms(self) -> float | None:
        """`deviation_rms_mm` in metres."""
        return None if self.deviation_rms_mm is None else 1e-3 * self.deviation_rms_mm


@dataclass(frozen=True)
class AnimationSummary:
    """How the animation changed.

    Attributes
    ----------
    pushed_deg, unpushed_deg : float
        Largest difference of a joint's rotation between h(p) and h at the curve's nearest point, while the hand does
        something (and until the stylus is back) and otherwise; the first second left out. Of a curve that is bent, h at
        the same phase of the curve that was given.
    """

    pushed_deg: float
    unpushed_deg: float


@dataclass(frozen=True)
class TraceSummary:
    """A hand that traces the curve by itself.

    Attributes
    ----------
    deviation_rms_mm : float
        Distance of the stylus from the curve after the first second.
    peak_force : float
        Largest force of the hand [N].
    """

    deviation_rms_mm: float
    peak_force: float

    def line(self) -> str:
        """What happened, in a sentence."""
        return (
            f"The hand traced the curve by itself, within {self.deviation_rms_mm:.2f} mm RMS and with up to "
            f"{self.peak_force:.1f} N."
        )


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

    def line(self) -> str:
        """How it followed, in a sentence; until it fell, if it did."""
        return (
            ("" if self.fell_at is None else "Until it fell: ")
            + f"The physical figure followed within {self.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{self.root_error_rms_cm:.2f} cm at the root; residual force {100 * self.residual_force_rms:.1f} % "
            f"of body weight RMS, feet on the ground {100 * self.grounded:.0f} % of stance."
        )


@dataclass(frozen=True)
class SpeedSummary:
    """What the run cost: simulated over real time, seconds until the first tick, and peak memory [MB]."""

    real_time_factor: float
    first_tick_seconds: float
    peak_memory_mb: float
