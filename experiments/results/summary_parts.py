"""What is measured of a run: the stylus, the animation, the tank, the figure, the computer."""

from dataclasses import dataclass

from sim.body.residual import Residual

_TOLD = 5  # falls that are told one by one
_TOLD_SECONDS = 0.01  # without ground force, of which figures are told


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
    stopped_at : float or None
        From when on the stylus stood still within a millimetre until the end, if that was a second or more [s]: on an
        open curve it stays at its end.
    pace : float or None
        At which the clips were played while it moved, as a share of their own; None where a lap plays none.
    """

    deviation_rms_mm: float | None
    deviation_max_mm: float
    laps: float
    lap_seconds: float | None
    pushes: tuple[PushSummary, ...]
    stopped_at: float | None = None
    pace: float | None = None

    def line(self) -> str | None:
        """When it stopped, and at what pace it went, in a sentence, if there is anything to say."""
        stopped = "" if self.stopped_at is None else f"The stylus stood still from {self.stopped_at:.1f} s on."
        paced = "" if self.pace is None else f"The clips were played at {self.pace:.2f} of their own pace."
        return " ".join(part for part in (stopped, paced) if part) or None

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
    lowest_sole_cm : float
        Least height of a point of the soles over the floor.
    foot_skate_cm : float
        Largest way over the floor of a point of the soles while it is within 3 mm of the floor.
    """

    pushed_deg: float
    unpushed_deg: float
    lowest_sole_cm: float = 0.0
    foot_skate_cm: float = 0.0

    def soles(self) -> str:
        """Of its soles, in a sentence."""
        lowest = round(self.lowest_sole_cm, 1) + 0.0  # no minus before a zero
        return f"Its lowest sole is at {lowest:+.1f} cm, and its feet skate {self.foot_skate_cm:.1f} cm at most."


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
    """How the physical figure followed the animation while it was up.

    Attributes
    ----------
    falls : tuple of float
        When it fell [s].
    fell_at : float or None
        The first of them.
    seconds, up_seconds : float
        How long it was looked at [s], and for how much of that it was up: neither lying after a fall nor being set back
        onto the animation. What follows is of that time.
    joint_error_rms_deg, root_error_rms_cm, root_error_max_cm : float
    residual_force_rms : float
        Of `stance`: residual force while the reference stands, as a share of body weight.
    stance, flight, without_ground_force : Residual
        Residual while a foot of the reference stands, while it flies, and while the ground does not bear the figure,
        whatever the reference does.
    residual_in_flight_max : float
        Largest share in `flight`; zero by construction.
    flight_seconds, lost_contact_seconds : float
        For how long the reference flies [s], and for how long the ground bears nothing though a foot of it stands.
    saturated : float
        Share of the motors' time at their limit.
    grounded : float
        Share of the time in which the reference stands that the ground bears the figure.
    ground_force_mean : float
        Mean vertical ground force as a share of body weight.
    """

    falls: tuple[float, ...]
    fell_at: float | None
    seconds: float
    up_seconds: float
    joint_error_rms_deg: float
    root_error_rms_cm: float
    root_error_max_cm: float
    residual_force_rms: float
    stance: Residual
    flight: Residual
    without_ground_force: Residual
    residual_in_flight_max: float
    flight_seconds: float
    lost_contact_seconds: float
    saturated: float
    grounded: float
    ground_force_mean: float

    def fall_line(self) -> str | None:
        """When it fell, and what its figures are of, in a sentence, if it did."""
        if not self.falls:
            return None
        when = ", ".join(f"{at:.1f}" for at in self.falls[:_TOLD]) + (", …" if len(self.falls) > _TOLD else "")
        times = "" if len(self.falls) == 1 else f" ({len(self.falls)} falls)"
        return (
            f"The physical figure fell at {when} s{times}; what is said of it is of the {self.up_seconds:.1f} of "
            f"{self.seconds:.1f} s in which it was up."
        )

    def lines(self) -> list[str]:
        """How it followed, a sentence or two."""
        stance, lost = self.stance, self.without_ground_force
        airborne = f"In {lost.seconds:.2f} s without ground force the residual is {lost.brief()}."
        return [
            f"The physical figure followed within {self.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{self.root_error_rms_cm:.2f} cm at the root; residual force {100 * self.residual_force_rms:.1f} % "
            f"of body weight RMS, feet on the ground {100 * self.grounded:.0f} % of stance.",
            f"Residual in stance, RMS and peak: {stance.brief()} ({stance.verdict()})."
            + (f" {airborne}" if lost.seconds >= _TOLD_SECONDS else ""),
        ]


@dataclass(frozen=True)
class SpeedSummary:
    """What the run cost: simulated over real time, seconds until the first tick, and peak memory [MB]."""

    real_time_factor: float
    first_tick_seconds: float
    peak_memory_mb: float
