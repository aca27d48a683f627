r"""Ballistic certificate: whether the flights of a motion are physically feasible, and at which playing rates.

A flight recorded under gravity ĝ falls with σ² ĝ at the rate σ. Two tolerances bound σ:

.. math:: g_{min} \le \sigma^2 \hat g \le g_{max} \quad\text{(seen)}, \qquad
          \min_{p_0, v_0} \max_t \lVert c_\sigma(t) - p_0 - v_0 t + \tfrac12 g t^2 e_z \rVert \le d \quad\text{(done)} .

The first is what viewers accept; the second is what a body in free fall can do after the best possible take-off.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controllers.certificates.flight import flight_fit
from controllers.certificates.flight.tolerance import BallisticTolerance
from controllers.certificates.report import Outcome, Verdict
from controllers.errors import ParameterError
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY

# A turn about the vertical that begins and ends in the air, over the largest deviation in it from constant momentum.
_TURN_RATIO = 9.4
_MIN_GRAVITY_RATIO = 0.12  # of g: a slower fall, to be played at over 2.9 times its speed, is hardly a slowed recording


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Data of a motion of n frames for the certificate.

    Parameters
    ----------
    fps : float
        Frames per second [1/s].
    com, angular : array, shape (n, 3)
        Centre of mass [m] and angular momentum about it [kg m²/s], in the world.
    inertia : array, shape (n, 3, 3)
        Inertia tensor about the centre of mass [kg m²].
    clearance : array, shape (n,)
        Height of the lowest point of the body over the floor [m].
    supported : array of bool, shape (n,)
        Whether any contact bears load.

    Raises
    ------
    ParameterError
        If the shapes do not fit together, or a number is not finite.
    """

    fps: float
    com: Array
    angular: Array
    inertia: Array
    clearance: Array
    supported: Mask

    def __post_init__(self) -> None:
        n = len(self.supported)
        for name, shape in (("com", (n, 3)), ("angular", (n, 3)), ("inertia", (n, 3, 3)), ("clearance", (n,))):
            array: Array = getattr(self, name)
            if array.shape != shape or not np.isfinite(array).all():
                raise ParameterError(f"{name} has shape {array.shape}; expected finite numbers of shape {shape}")


@dataclass(frozen=True, eq=False)
class FlightJudgement:
    """Verification result of one flight.

    Attributes
    ----------
    fit : FlightFit
        The fitted parabola.
    verdict : {"certified", "refuted", "unknown"}
        Whether the flight is feasible as recorded.
    reason : str
        Explanation with numbers.
    seen : (float, float)
        Rates σ at which viewers accept it as natural.
    done : (float, float) or None
        Rates at which a body in free fall stays within the tolerance; None if there are none.
    """

    fit: flight_fit.FlightFit
    verdict: Outcome
    reason: str
    seen: tuple[float, float]
    done: tuple[float, float] | None

    @property
    def admissible(self) -> tuple[float, float]:
        """Rates in both `seen` and `done`; `seen` alone if the two do not overlap."""
        if self.done is None:
            return self.seen
        low, high = max(self.seen[0], self.done[0]), min(self.seen[1], self.done[1])
        return (low, high) if low <= high else self.seen


def judge_flights(motion: BodyMotion, tolerance: BallisticTolerance) -> tuple[FlightJudgement, ...]:
    """Find and judge all flights of a motion."""
    spans = flight_fit.find_flights(motion.supported, motion.fps)
    return tuple(_judge(motion, span, tolerance) for span in spans)


def _judge(motion: BodyMotion, span: tuple[int, int], tolerance: BallisticTolerance) -> FlightJudgement:
    fit = flight_fit.fit_flight(span, motion.fps, motion.com, motion.angular, motion.inertia, motion.clearance)
    low, high = tolerance.gravity
    likely = fit.likely_gravity
    seen = (float(np.sqrt(low / likely)), float(np.sqrt(high / likely))) if likely > 0.0 else (np.inf, np.inf)
    done = flight_fit.reachable_rates(motion.com[span[0] : span[1] + 1], motion.fps, tolerance.distance)
    falls = f"falls at {fit.gravity:.1f} ± {fit.uncertainty:.1f} m/s²"
    verdict: Outcome = "refuted"
    if likely < low and fit.clearance < tolerance.clearance:
        verdict = "unknown"
        why = f"{falls} and rises only {100 * fit.clearance:.0f} cm: it may stand on a floor not in the recording"
    elif not low <= likely <= high:
        explanation = "; it stands on something not in the recording, such as a box, or the frame rate is wrong"
        if fit.gravity > _MIN_GRAVITY_RATIO * GRAVITY:
            explanation = f"; played at {fit.natural_rate:.2f} of its speed it would fall with g"
        why = f"{falls}, not within {low:g} to {high:g}{explanation}"
    elif fit.misfit > tolerance.misfit:
        why = f"is {100 * fit.misfit:.1f} cm (RMS) from a parabola, more than {100 * tolerance.misfit:g}"
    elif fit.drift > tolerance.drift:
        why = (
            f"turns {np.rad2deg(fit.drift):.0f}° away from constant angular momentum, "
            f"more than {np.rad2deg(tolerance.drift):.0f}°"
        )
    elif fit.yaw > tolerance.yaw:
        why = (
            f"turns {np.rad2deg(fit.yaw):.0f}° about the vertical away from constant angular momentum, "
            f"more than {np.rad2deg(tolerance.yaw):.0f}°"
        )
    else:
        verdict, why = "certified", falls
    return FlightJudgement(fit, verdict, f"flight at {fit.time:.2f} s, {fit.duration:.2f} s long, {why}", seen, done)


def ballistic_verdict(
    motion: BodyMotion,
    flights: Sequence[FlightJudgement],
    tolerance: BallisticTolerance,
    doubts: Sequence[str] = (),
    measures: Mapping[str, object] | None = None,
) -> Verdict:
    """Verdict on a whole motion: that of its worst flight, but unknown if its support may not be real contact.

    `doubts` and `measures` are those of `contact_doubts`.

    The margin is the smallest distance, over all flights, of the rate 1 from the ends of the interval `seen`: how much
    faster or slower the motion may be played. It is negative if the gravity of a flight refutes the motion.
    The counterexample of a refuted motion is the best take-off of its first refuted flight: the position and velocity
    with which free fall stays nearest to the recorded centre of mass, and its largest ``distance`` from it [m].
    """
    unnoticed = _TURN_RATIO * np.rad2deg(tolerance.yaw)
    assumptions = (
        f"gravity is {GRAVITY} m/s², without drag, on the figure's own size and mass",
        f"what viewers accept is {tolerance.gravity[0]:g} to {tolerance.gravity[1]:g} m/s²",
        "the gravity of a flight is known to its 95 % interval; within it, the benefit of the doubt",
        "flights are what contacts of feet, hands and other parts leave, of five frames and "
        f"{flight_fit.MIN_FLIGHT_DURATION} s or more",
        f"a turn about the vertical of up to {unnoticed:.0f}° that begins and ends in the air is not noticed",
    )
    figures: dict[str, object] = {**(measures or {})}
    doubt_text = "; ".join(doubts)
    if not flights:
        if doubts:
            return Verdict("unknown", f"no flight, but {doubt_text}", None, assumptions, figures=figures)
        return Verdict("certified", "no flight: nothing has to fall", None, assumptions, figures=figures)
    refuted = [flight for flight in flights if flight.verdict == "refuted"]
    doubtful = [flight for flight in flights if flight.verdict == "unknown"]
    margin = min(min(1.0 - flight.seen[0], flight.seen[1] - 1.0) for flight in flights)
    figures["flights"] = [_figures(flight) for flight in flights]
    if refuted:
        fit = refuted[0].fit
        com = motion.com[fit.start : fit.end + 1]
        distance, (position, velocity) = flight_fit.fit_free_fall(com, motion.fps, 1.0)
        counterexample = {
            "start": fit.start, "end": fit.end, "position": position, "velocity": velocity,
            "momentum": fit.momentum, "distance": distance,
        }  # fmt: skip
        reason = "; ".join(flight.reason for flight in refuted)
        return Verdict("refuted", reason, margin, assumptions, counterexample, figures)
    reasons = [*(flight.reason for flight in doubtful or flights), *doubts]
    outcome = "unknown" if doubtful or doubts else "certified"
    return Verdict(outcome, "; ".join(reasons), margin, assumptions, figures=figures)


def _figures(flight: FlightJudgement) -> dict[str, object]:
    fit = flight.fit
    return {
        "verdict": flight.verdict, "start": fit.start, "end": fit.end, "time": fit.time, "duration": fit.duration,
        "gravity": fit.gravity, "gravity_uncertainty": fit.uncertainty, "natural_rate": fit.natural_rate,
        "misfit": fit.misfit, "rise": fit.rise, "take_off": fit.take_off, "take_off_speed": fit.take_off_speed,
        "clearance": fit.clearance, "momentum": fit.momentum, "drift": fit.drift,
        "yaw": fit.yaw,
        "rate_seen": list(flight.seen), "rate_done": None if flight.done is None else list(flight.done),
        "rate_admissible": list(flight.admissible),
    }  # fmt: skip
