r"""Admissible playing rates of a motion at each frame: in flight by gravity, on the floor by the friction cone.

On the floor, a body whose centre of mass accelerates by a needs the ground reaction force m (a + g e_z), within the
friction cone. At the rate σ the acceleration is σ² a, so

.. math:: \sigma^2 (\lVert a_h \rVert - \mu a_z) \le \mu g .

In a turn of radius r at speed v this is v² / r ≤ μ g; for a vertical acceleration alone it means that the floor cannot
pull.

Accelerations are those of the least-squares parabola through a window of frames, a = Σ c_i p_i (Savitzky & Golay 1964).
This is a mean, with weights ≥ 0, of the accelerations in the window, so for every body that the floor supports it lies
within the (convex) cone. If a lies outside the cone by d, each such body misses some frame of the window by at least
d / Σ|c_i|.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from controllers.certificates.flight.ballistic import BodyMotion, FlightJudgement
from controllers.certificates.report import Verdict
from controllers.errors import ParameterError
from geometry.arrays import Array
from geometry.physics import GRAVITY

ANY_RATE = 100.0  # a larger admissible rate is no practical bound
_WINDOW = 0.2  # [s] window of the local parabolas whose second derivative is the acceleration


class RateBounds(NamedTuple):
    """Admissible rates of a motion, frame by frame.

    Attributes
    ----------
    low, high : array, shape (n,)
        Smallest and largest σ; 0 and infinity where there is no bound.
    """

    low: Array
    high: Array

    def stylus_speed(self, phases: Array, speed: Array) -> tuple[Array, Array]:
        """Admissible speeds of the stylus along a curve that plays the motion: σ |φ̇|.

        Between two frames, the narrower of their bounds applies.

        Parameters
        ----------
        phases : array, shape (m,)
            Elapsed fraction of the motion at samples of the curve, 0 to 1.
        speed : array, shape (m,)
            |φ̇| there when the motion is played as recorded [m/s].

        Returns
        -------
        low, high : array, shape (m,)
            Smallest and largest speed [m/s].

        Raises
        ------
        ParameterError
            If the shapes differ, a phase is outside 0 to 1, or a speed is negative or not finite.
        """
        if phases.ndim != 1 or phases.shape != speed.shape:
            raise ParameterError(f"phases {phases.shape} and speed {speed.shape}; expected two arrays of shape (m,)")
        if not (np.all((phases >= 0.0) & (phases <= 1.0)) and np.all(np.isfinite(speed) & (speed >= 0.0))):
            raise ParameterError("phases must lie within 0 and 1, speeds be finite and not negative")
        at = phases * (len(self.low) - 1)
        before, after = np.floor(at + 1e-9).astype(np.int64), np.ceil(at - 1e-9).astype(np.int64)
        low = np.maximum(self.low[before], self.low[after]) * speed
        fastest = np.minimum(self.high[before], self.high[after])
        # Where the curve is at rest, the speed is zero at any rate, even an infinite one.
        return low, np.where(speed > 0.0, fastest * np.maximum(speed, 1e-12), 0.0)


def rate_bounds(motion: BodyMotion, flights: Sequence[FlightJudgement], friction: float) -> RateBounds:
    """Admissible rates of every frame.

    Parameters
    ----------
    motion : BodyMotion
        n frames.
    flights : sequence of FlightJudgement
        Flights of the motion; a flight with the verdict "unknown" counts as support.
    friction : float
        μ, coefficient of friction of soles on the floor.
    """
    low, high = np.zeros(len(motion.com)), floor_rates(motion, friction)
    for flight in flights:
        if flight.verdict != "unknown":
            span = slice(flight.fit.start, flight.fit.end + 1)
            low[span], high[span] = flight.admissible
    return RateBounds(low, high)


def floor_rates(motion: BodyMotion, friction: float) -> Array:
    """Greatest rate at which a unilateral floor with friction can give the acceleration of each frame, (n,).

    Raises
    ------
    ParameterError
        If the coefficient of friction is not positive.
    """
    if not (np.isfinite(friction) and friction > 0.0):
        raise ParameterError(f"the coefficient of friction is {friction}; expected a finite number > 0")
    window = _window_frame_count(motion.fps)
    if len(motion.com) < window:
        return np.full(len(motion.com), np.inf)
    a = _mean_acceleration(motion)
    needed = np.linalg.norm(a[:, :2], axis=1) - friction * a[:, 2]
    return np.where(needed > 0.0, np.sqrt(friction * GRAVITY / np.maximum(needed, 1e-12)), np.inf)


def _window_frame_count(fps: float) -> int:
    return 2 * max(2, round(_WINDOW * fps / 2)) + 1


def _mean_acceleration(motion: BodyMotion) -> Array:
    """Acceleration of the least-squares parabola about each frame, (n, 3); the first and last windows are extended."""
    from scipy.signal import savgol_filter  # imported late: loads scipy.stats

    window = _window_frame_count(motion.fps)
    return np.asarray(savgol_filter(motion.com, window, 2, deriv=2, delta=1.0 / motion.fps, axis=0))


def turns_verdict(motion: BodyMotion, flights: Sequence[FlightJudgement], friction: float, frames: int) -> Verdict:
    """Verdict on whether friction can turn, start and stop the first `frames` as recorded; margin is the least σ² − 1.

    The counterexample is the window of frames ``start`` to ``end`` about the most demanding ``frame``: the centre of
    mass [m] and its velocity [m/s] at the start, its mean ``acceleration`` [m/s²], and the ``distance`` [m] by which
    every body on that floor misses the window, whatever its initial state.
    """
    high = floor_rates(motion, friction)
    for flight in flights:
        high[flight.fit.start : flight.fit.end + 1] = np.inf
    frame = int(np.argmin(high[:frames]))
    rate = float(high[frame])
    assumptions = (
        f"coefficient of friction {friction:g}, the floor cannot pull",
        f"accelerations are those of the centre of mass, averaged over {_WINDOW:g} s",
    )
    if not np.isfinite(rate):
        return Verdict("certified", "nothing turns, starts or stops on the floor", None, assumptions)
    # Enough decimals to tell a rate below 1 from 1.
    digits = next((k for k in range(2, 16) if round(rate, k) < 1.0), 2)
    up_to = f"up to {rate:.{digits}f} of" if rate < ANY_RATE else f"more than {ANY_RATE:g} times"
    reason = f"friction permits {up_to} its speed; the critical frame is at {frame / motion.fps:.2f} s"
    if rate >= 1.0:
        return Verdict("certified", reason, rate**2 - 1.0 if rate < ANY_RATE else None, assumptions)
    counterexample = {"frame": frame, "rate": rate, **_window_counterexample(motion, frame, friction)}
    within = np.format_float_positional(1e3 * counterexample["distance"], 2, unique=False, fractional=False, trim="-")
    reason = f"{reason}, which no body on that floor follows within {within} mm"
    return Verdict("refuted", reason, rate**2 - 1.0, assumptions, counterexample)


def _window_counterexample(motion: BodyMotion, frame: int, friction: float) -> dict[str, Any]:
    from scipy.signal import savgol_coeffs, savgol_filter

    window, delta = _window_frame_count(motion.fps), 1.0 / motion.fps
    start = int(np.clip(frame - window // 2, 0, len(motion.com) - window))
    a = _mean_acceleration(motion)[frame]
    level = float(np.linalg.norm(a[:2]))
    push = float(a[2]) + GRAVITY
    # For a force within the polar cone, the nearest point of the friction cone is its apex.
    outside = (level - friction * push) / np.hypot(1.0, friction) if push > -friction * level else np.hypot(level, push)
    per_metre = float(np.abs(savgol_coeffs(window, 2, deriv=2, delta=delta)).sum())
    span = slice(start, start + window)
    velocity = savgol_filter(motion.com[span], window, 2, deriv=1, delta=delta, axis=0)[0]
    return {
        "start": start, "end": start + window - 1, "com": motion.com[start], "velocity": velocity, "acceleration": a,
        "distance": float(outside) / per_metre,
    }  # fmt: skip
