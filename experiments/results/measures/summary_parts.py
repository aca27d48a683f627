"""Parts of a run's summary: stylus, animation, energy tank, figure, computing speed."""

from dataclasses import dataclass

from sim.body.residual import Residual

_MAX_LISTED_FALLS = 5  # falls that are listed one by one
_EVEN_PACE = 0.85, 1.2  # interval of the hand's pace over its mean: the default push keeps it within 0.87 and 1.18
_MAX_JOINT_SPEED = 140.0  # [rad/s] the fastest, the shoulder of a pitcher, turns at some 130
_MIN_REPORTED_TIME = 0.01  # [s] without ground force from which its residual is reported


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
        Largest distance from the curve during the push; in a field without a curve, from where the push began.
    along_push : float
        Cosine between force and deviation where the deviation is largest: 1 if the stylus moved along the push.
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
    """How the stylus followed the curve; a bent curve as it is bent.

    Attributes
    ----------
    deviation_rms_mm, deviation_max_mm : float or None
        Distance from the curve after the first second, without the times in which the hand exerts a force and the
        second after them; None if nothing is left, as of a hand that traces, or in a run of a second.
    laps : float
        Phase travelled over the duration of the curve: laps, if the curve is closed.
    lap_seconds : float or None
        Mean time of a lap; None if there was no whole lap.
    pushes : tuple of PushSummary
        Pushes of the hand; grabbing, tracing and leading are none.
    stopped_at : float or None
        Time from which the stylus stood still within a millimetre until the end, if that was a second or more [s], as
        it does at the end of an open curve.
    pace : float or None
        Pace at which the clips of the legs were played while the stylus moved, relative to their own; None if a lap
        plays no clip, or the field has no curve.
    paces : tuple of float
        The same of each clip that is played.
    pace_spread : tuple of float, optional
        Paces of the hand over its mean pace that it fell below, and exceeded, for a twentieth of the time each, after
        the first second; None as `pace`, and of a hand that stops or goes back, such as one that bends a curve.
    """

    deviation_rms_mm: float | None
    deviation_max_mm: float | None
    laps: float
    lap_seconds: float | None
    pushes: tuple[PushSummary, ...]
    stopped_at: float | None = None
    pace: float | None = None
    paces: tuple[float, ...] = ()
    pace_spread: tuple[float, float] | None = None

    def line(self, played: bool) -> str | None:
        """When the stylus stopped, and at what pace clips were played if they were; None if neither applies."""
        stopped = "" if self.stopped_at is None else f"The stylus stood still from {self.stopped_at:.1f} s on."
        ends = dict.fromkeys(f"{pace:.2f}" for pace in sorted(self.paces)[:: max(len(self.paces) - 1, 1)])
        low, high = self.pace_spread or (1.0, 1.0)
        uneven = (
            f"; the hand was below {low:.2f} and above {high:.2f} of its mean pace for a twentieth of the time each"
            if low < _EVEN_PACE[0] or high > _EVEN_PACE[1]
            else ""
        )
        paced = (
            f"The clips were played at {' to '.join(ends)} of their recorded speed{uneven}." if ends and played else ""
        )
        return " ".join(part for part in (stopped, paced) if part) or None

    def left_alone(self, curve: str) -> str:
        """How far the stylus was from a curve, such as ``the curve``, when the hand left it alone."""
        if self.deviation_rms_mm is None:
            return f"never left alone on {curve} for more than a second"
        return f"{self.deviation_rms_mm:.2f} mm RMS from {curve} when left alone"

    @property
    def deviation_rms(self) -> float | None:
        """`deviation_rms_mm` in metres."""
        return None if self.deviation_rms_mm is None else 1e-3 * self.deviation_rms_mm


@dataclass(frozen=True)
class AnimationSummary:
    """How the animation changed.

    Attributes
    ----------
    pushed_deg : float or None
        Largest difference of a joint's rotation between h(p) and h at the curve's nearest point, while the hand exerts
        a force and for a second after; None if it exerts none. If the curve is bent, the comparison is with h at the
        same phase of the unedited curve.
    unpushed_deg : float or None
        The same at all other times after the first second; None if there are none.
    lowest_sole_cm : float
        Least height of a point of the soles above the floor.
    foot_skate_cm : float
        Largest slide of a point of the soles while it is within 3 mm of the floor (`models.mocap.motion.foot_skate`).
    fastest_joint : float
        Largest angular velocity of a joint [rad/s].
    """

    pushed_deg: float | None
    unpushed_deg: float | None
    lowest_sole_cm: float = 0.0
    foot_skate_cm: float = 0.0
    fastest_joint: float = 0.0

    @property
    def changed_deg(self) -> float | None:
        """Largest difference at any time; None if there is none."""
        return max((x for x in (self.pushed_deg, self.unpushed_deg) if x is not None), default=None)

    def changed(self, pushes: bool, digits: int) -> str:
        """By how much a joint's rotation changed, apart where the hand pushed if it did; empty if not measured."""
        if pushes and self.pushed_deg is not None:
            elsewhere = "" if self.unpushed_deg is None else f", {self.unpushed_deg:.{digits}f}° elsewhere"
            return f"{self.pushed_deg:.1f}° a joint where it was pushed{elsewhere}"
        return "" if self.changed_deg is None else f"{self.changed_deg:.{digits}f}° a joint"

    def soles(self) -> str:
        """Height and slide of the soles, and a joint that is faster than any of a human body, in a sentence."""
        lowest = round(self.lowest_sole_cm, 1) + 0.0  # no minus before a zero
        jump = f", and a joint jumps ({self.fastest_joint:.0f} rad/s)" if self.fastest_joint > _MAX_JOINT_SPEED else ""
        slide = f"soles slide {self.foot_skate_cm:.1f} cm at most"
        return f"The animation's lowest sole is at {lowest:+.1f} cm; {slide}{jump}."


@dataclass(frozen=True)
class TraceSummary:
    """How a hand moved that does not merely let itself be guided.

    Attributes
    ----------
    deviation_rms_mm : float or None
        Distance of the stylus from the curve after the first second; None in a shorter run.
    peak_force : float
        Largest force of the hand [N].
    """

    deviation_rms_mm: float | None
    peak_force: float

    def line(self) -> str:
        """Summary in a sentence."""
        away = "" if self.deviation_rms_mm is None else f"within {self.deviation_rms_mm:.2f} mm RMS of the curve and "
        return f"The hand moved by itself, {away}with up to {self.peak_force:.1f} N."


@dataclass(frozen=True)
class ReplaySummary:
    """A replayed hand, which moved as it was recorded.

    Attributes
    ----------
    run : str
        Folder of the run whose hand it was.
    deviation_rms_mm : float
        Distance of the stylus from what the field leads along.
    distance_from : str
        What that is, such as the curve.
    """

    run: str
    deviation_rms_mm: float
    distance_from: str

    def line(self) -> str:
        """Summary in a sentence."""
        return (
            f"The hand was that of {self.run} and moved as recorded, whatever the force: "
            f"{self.deviation_rms_mm:.2f} mm RMS from {self.distance_from}."
        )


@dataclass(frozen=True)
class TankSummary:
    """How much of its energy budget the field needed.

    Attributes
    ----------
    least_mj : float
        Least energy in the tank [mJ].
    scaled_ticks : int
        Number of ticks at which the tank scaled the force down.
    """

    least_mj: float
    scaled_ticks: int


@dataclass(frozen=True)
class FigureSummary:
    """How the physical figure followed the animation while it was up.

    Attributes
    ----------
    falls : tuple of float
        Times of its falls [s].
    fell_at : float or None
        Time of the first fall [s].
    seconds, up_seconds : float
        Time measured [s], and the part of it in which the figure was up: neither lying after a fall nor being set back
        onto the animation. All measures below are over that part.
    joint_error_rms_deg : float
        Angle between a joint's rotation and that of the reference, RMS over joints and time [°].
    root_error_rms_cm, root_error_max_cm : float
        Distance of the root from that of the reference [cm].
    residual_force_rms : float
        RMS residual force while the reference is in stance, as a share of body weight; that of `stance`.
    stance, flight, without_ground_force : Residual
        Residual while the reference is in stance, while it is in flight, and while there is no ground reaction force,
        whatever the reference does.
    residual_in_flight_max : float
        Largest residual in `flight`, force or moment; zero by construction.
    flight_seconds, lost_contact_seconds : float
        Time in which the reference is in flight [s], and time without ground reaction force though it is in stance.
    saturated : float
        Mean share of the joint motors that are at their limit.
    grounded : float
        Share of the stance of the reference in which the ground bears the figure.
    ground_force_mean : float
        Mean vertical ground reaction force as a share of body weight.
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
        """When the figure fell, and over which time it is measured, in a sentence; None if it did not fall."""
        if not self.falls:
            return None
        when = ", ".join(f"{at:.1f}" for at in self.falls[:_MAX_LISTED_FALLS]) + (
            ", …" if len(self.falls) > _MAX_LISTED_FALLS else ""
        )
        times = "" if len(self.falls) == 1 else f" ({len(self.falls)} falls)"
        return (
            f"The physical figure fell at {when} s{times}; its measures are over the {self.up_seconds:.1f} of "
            f"{self.seconds:.1f} s in which it was up."
        )

    def lines(self) -> list[str]:
        """Tracking and residual in words, one sentence per line."""
        stance, lost = self.stance, self.without_ground_force
        airborne = f"In {lost.seconds:.2f} s without ground force the residual is {lost.brief()}."
        return [
            f"The physical figure followed within {self.joint_error_rms_deg:.2f}° RMS at the joints and "
            f"{self.root_error_rms_cm:.2f} cm at the root; residual force {100 * self.residual_force_rms:.1f} % "
            f"of body weight RMS, feet on the ground {100 * self.grounded:.0f} % of stance.",
            f"Residual in stance, RMS and peak: {stance.brief()} ({stance.verdict()})."
            + (f" {airborne}" if lost.seconds >= _MIN_REPORTED_TIME else ""),
        ]


@dataclass(frozen=True)
class SpeedSummary:
    """Cost of the run.

    Attributes
    ----------
    real_time_factor : float
        Simulated over real time.
    first_tick_seconds : float
        Time until the first tick [s].
    peak_memory_mb : float
        Largest memory of the process [MB].
    """

    real_time_factor: float
    first_tick_seconds: float
    peak_memory_mb: float
