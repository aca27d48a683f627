r"""Switching of crossing rivers: conditions under which the active river keeps the hand, and bounds on the dwell time.

On river i, with a loop that is linear transverse to the curve, the hand's distance is at most D and the error of its
measured velocity at most E,

.. math:: D = G_d U, \qquad E = G_e U + \nu, \qquad
          U = U_{max} + U_0 + U_q + (k D + b E)(1 - w(D/\varepsilon))

with G the peak gains of the sampled loop; U_max the hand's force, U_0 that of inertia and friction (`own_force`), U_q
and ν the effects of encoder quantisation on the law's force and on the measured velocity. The velocity that selects a
river is low-passed with the time constant τ_s. The filter amplifies no error, and lags behind the current's velocity by
at most τ_s |φ̈|, so the error is at most E_s = E + τ_s |φ̈|. Hence, as long as the river is active, the mismatch of
`HigherOrder` obeys s_i² ≤ S² = E_s² + g_i(D) with g = −2σ² ln w. The discount of a competing river's mismatch (see
`mismatch`) removes at most the part of e across its tangent, so with u_j its unit tangent

.. math:: s_j^2 \ge \max(0, |\dot\varphi_i \cdot u_j - |\dot\varphi_j|| - E_s)^2 + g_j(d_j - D)

The discrete field keeps the hand if S < r + h and S < h + s_j: the river never changes; the dwell time is infinite.

Dwell time: between two opposite changes of river s_j − s_i changes by 2 h, and between admission and release s_i by h.
m is the distance of (e, 0) from the line along (Y, |φ̇|), so |Δm| ≤ |Δe| + |e| |ΔY|/|φ̇|; and √g is Lipschitz in d. From
this, `hysteresis_dwell` bounds the dwell time from below wherever the hand is near the curves.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from controllers.certificates.loop.energy import own_force, peak_gain
from controllers.certificates.loop.linear_loop import LinearLoop
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.report import Verdict
from controllers.certificates.switching.common_lyapunov import Common
from controllers.curves.closest_point import closest_phases
from controllers.fields.algebra.weights import window
from geometry.arrays import Array

CORE_FRACTION = 0.1  # fraction of a tube's radius within which the hysteresis bounds the dwell time
# Steepest ε/σ · d√g/dd in the core.
_MAX_COST_SLOPE = 6.0 * CORE_FRACTION / ((1.0 - CORE_FRACTION**2) * math.sqrt(-6.0 * math.log(1.0 - CORE_FRACTION**2)))


@dataclass(frozen=True)
class SelectionRule:
    """Parameters of `HigherOrder` that decide how rivers share the hand.

    Parameters
    ----------
    admission, sigma, hysteresis : float
        r, σ, h [m/s].
    form : {"smooth", "discrete"}
        See `HigherOrder`.
    look : float
        τ_s, time constant of the low-pass on the selecting velocity [s]; 0 for none.
    """

    admission: float
    sigma: float
    hysteresis: float
    form: Literal["smooth", "discrete"]
    look: float

    def cost(self, distance: float, width: float) -> float:
        """Penalty of a distance from the curve, g(d) = −2σ² ln w(d/ε) [m²/s²]; infinite outside the tube."""
        w = float(window((distance / width) ** 2))
        return -2.0 * self.sigma**2 * math.log(w) if w > 0.0 else math.inf


@dataclass(frozen=True)
class CompetingRiver:
    """A competing river j relative to a river i, at the n phases of i.

    Attributes
    ----------
    distance : Array, shape (n,)
        Distance of the curves [m].
    least : Array, shape (n,)
        |φ̇_i · u_j − |φ̇_j||, the smallest possible mismatch: after the largest discount [m/s].
    angle : Array, shape (n,)
        Angle between the curves [rad].
    width : float
        ε_j [m].
    """

    distance: Array
    least: Array
    angle: Array
    width: float


def competing_river(held: CertifiedRiver, other: CertifiedRiver) -> CompetingRiver:
    """Another river relative to `held`, at the phases of `held`."""
    points, velocity = held.curve.point(held.phases()), held.curve.velocity(held.phases())
    phases, distance = closest_phases(other.curve.packed(), points)
    other_velocity = other.curve.velocity(phases)
    speed = np.linalg.norm(other_velocity, axis=1)
    along = np.einsum("ni,ni->n", velocity, other_velocity) / speed
    return CompetingRiver(
        distance=distance, least=np.abs(along - speed), width=other.width,
        angle=np.arccos(np.clip(along / np.linalg.norm(velocity, axis=1), -1.0, 1.0)),
    )  # fmt: skip


@dataclass(frozen=True)
class Bounds:
    """Bounds on the hand's deviation from the state in which its river carries it, under a bounded force.

    Attributes
    ----------
    distance, speed : float
        D [m] and E [m/s]; infinite if there is no bound.
    score : float
        S [m/s].
    room : float
        The smaller of r + h − S and h + s_j − S [m/s]; the river keeps the hand if this is positive.
    """

    distance: float
    speed: float
    score: float
    room: float


@dataclass(frozen=True, eq=False)
class HandRetention:
    """One river of a bundle with the others as competitors: bounds under which it keeps its hand."""

    held: CertifiedRiver
    others: tuple[CertifiedRiver, ...]
    sharing: SelectionRule

    @cached_property
    def competing_rivers(self) -> tuple[CompetingRiver, ...]:
        """The other rivers relative to this one."""
        return tuple(competing_river(self.held, other) for other in self.others)

    @cached_property
    def lag(self) -> float:
        """Largest lag of the selecting velocity behind the current's, τ_s |φ̈| [m/s]."""
        turning = np.linalg.norm(self.held.curve.acceleration(self.held.phases()), axis=1)
        return self.sharing.look * float(turning.max())

    @cached_property
    def _still_loop(self) -> LinearLoop:
        return self.held.still()

    @cached_property
    def reading(self) -> float:
        """Largest error of the tip's position by encoder quantisation [m]."""
        half = 0.5 * np.array(self.held.device.encoder_step)
        return float(np.linalg.norm(np.abs(self._still_loop.jacobian) @ half, axis=1).max())

    @property
    def noise(self) -> float:
        """ν [m/s]: largest response of the velocity filter to quantisation errors, by its sum of |impulse response|."""
        sampling = self.held.sampling
        return 2.0 * (1.0 - sampling.keep) / sampling.period * self.reading

    @cached_property
    def _gains(self) -> tuple[float, float, float]:
        """G_d [m/N], G_e [m/(N s)], U_0 + U_q [N]."""
        river = self.held
        loop = SampledLoop(self._still_loop, river.sampling)
        own = float(own_force(river, river.moving()).max()) + river.k_r * self.reading + river.b_d * self.noise
        gain = peak_gain(loop, river.k_r, river.b_d)
        return gain.distance, gain.speed, own

    def bounds(self, push: float) -> Bounds:
        """D, E and S for |U| ≤ push [N]: the smallest solution, by iteration from zero."""
        river, sharing = self.held, self.sharing
        by_force, by_speed, own = self._gains
        unbounded = Bounds(math.inf, math.inf, math.inf, -math.inf)
        distance = speed = 0.0
        for _ in range(2000):
            if not (math.isfinite(distance + speed) and distance < river.width):
                return unbounded
            share = float(window((distance / river.width) ** 2))
            law_force = river.k_r * distance + river.b_d * speed
            force = push + own + law_force * (1.0 - share)
            updated = by_force * force, by_speed * force + self.noise
            if abs(updated[0] - distance) < 1e-12 and abs(updated[1] - speed) < 1e-12:
                break
            distance, speed = updated
        else:
            return unbounded
        speed_error = speed + self.lag
        score = math.sqrt(speed_error**2 + sharing.cost(distance, river.width))
        return Bounds(distance, speed, score, self._retention_margin(distance, speed_error, score))

    def _retention_margin(self, distance: float, speed_error: float, score: float) -> float:
        """Distance of S from the values at which the river would lose the hand [m/s], for an error of at most E_s."""
        least = self.sharing.admission + self.sharing.hysteresis - score
        for other in self.competing_rivers:
            inside = 1.0 - (np.maximum(0.0, other.distance - distance) / other.width) ** 2
            inside_tube = inside > 0.0
            distance_cost = -6.0 * self.sharing.sigma**2 * np.log(inside[inside_tube])
            competing_score = np.sqrt(np.maximum(0.0, other.least[inside_tube] - speed_error) ** 2 + distance_cost)
            least = min(least, float(np.min(self.sharing.hysteresis + competing_score - score, initial=math.inf)))
        return least

    def allowed(self, ceiling: float) -> float:
        """Largest force [N] up to a ceiling at which the river keeps the hand; negative if it may lose it at any."""
        if self.bounds(0.0).room <= 0.0:
            return -1.0
        low, high = 0.0, ceiling
        for _ in range(24):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.bounds(middle).room > 0.0 else (low, middle)
        return low


def hysteresis_dwell(retentions: Sequence[HandRetention], push: float) -> float:
    r"""Lower bound [s] of the time between two changes, within `CORE_FRACTION` of a tube's radius of the curves.

    .. math:: \tau_d = \frac{h - 2 (\nu + c\,\delta)}{a + c\,|e|}, \qquad
              c = \frac{|e|}{\tau |\dot\varphi|} + \kappa\frac{\sigma}{\varepsilon}, \qquad
              |e| \le (r + h)\sqrt{1 + (d/\tau|\dot\varphi|)^2}

    with a the largest acceleration, (U + f_c + k d + b |e|) over the smallest inertia at the tip; |e| also bounds the
    transverse speed; κ is the steepest slope of √g in the core; ν and δ are the quantisation errors of velocity and
    position. A larger h admits faster hands, so the bound does not grow without limit. It is at least one period, since
    the field is evaluated once per period, and exactly one period for h ≤ 2(ν + c δ).
    """
    dwell, period = math.inf, retentions[0].held.sampling.period
    for retention in retentions:
        river, sharing = retention.held, retention.sharing
        linear = river.still()
        inertia = np.linalg.eigvalsh(linear.jacobian @ np.linalg.inv(linear.mass) @ linear.jacobian.transpose(0, 2, 1))
        speeds = np.linalg.norm(river.curve.velocity(river.phases()), axis=1)
        spring_speed = CORE_FRACTION * river.width * river.k_r / river.b_d
        error = (sharing.admission + sharing.hysteresis) * math.sqrt(1.0 + (spring_speed / speeds.min()) ** 2)
        joints = np.linalg.norm(np.linalg.inv(linear.jacobian), 2, axis=(1, 2)).max()
        friction = float(joints * np.linalg.norm(river.device.coulomb))
        force = push + friction + river.k_r * CORE_FRACTION * river.width + river.b_d * error
        by_place = error * river.k_r / river.b_d / float(speeds.min()) + _MAX_COST_SLOPE * sharing.sigma / river.width
        rounding = retention.noise + by_place * retention.reading
        rate = float(inertia.max()) * force + by_place * error
        dwell = min(dwell, max(0.0, sharing.hysteresis - 2.0 * rounding) / rate)
    return max(period, dwell)


def switching(
    retentions: Sequence[HandRetention], push: float, ceiling: float, found: Mapping[str, object], common: Common | None
) -> Verdict:
    """Verdict on the switching of a bundle's rivers, for hands that push with at most `push` newtons.

    Certified if every river keeps its hand, so that the active river never changes; refuted by the counterexample of a
    search. The margin is the additional push that would be allowed [N].

    Parameters
    ----------
    retentions : sequence of HandRetention
        One for each river.
    push, ceiling : float
        U_max, and the largest force that is examined [N].
    found : mapping
        Counterexample; empty if there is none.
    common : Common, optional
        Common Lyapunov function of the rivers and of no river, for a hand on the stylus where rivers meet.
    """
    sharing = retentions[0].sharing
    allowed = min((retention.allowed(ceiling) for retention in retentions), default=-1.0)
    bounds = [retention.bounds(push) for retention in retentions]
    competing_rivers = [other for retention in retentions for other in retention.competing_rivers]
    least = min(
        (float(r.least[r.distance < 2.0 * r.width].min(initial=math.inf)) for r in competing_rivers), default=math.inf
    )
    figures: dict[str, object] = {
        "push_allowed": allowed,
        "score_bound": max(bound.score for bound in bounds),
        "distance_bound": max(bound.distance for bound in bounds),
        "velocity_noise": max(retention.noise for retention in retentions),
        "hysteresis": sharing.hysteresis,
        "hysteresis_dwell": hysteresis_dwell(retentions, push),
        "least_mismatch": least,
        "rival_weight": math.exp(-0.5 * (least / sharing.sigma) ** 2),
        "common_rate": None if common is None else common.rate,
        "common_p": None if common is None else common.p,
    }
    assumptions = (
        "the loop is linear across the curve; kinematics and inertia off the curve are those on it",
        "the hand begins where its river carries it; its force is bounded and has no impedance",
        "phases: a grid of the curves; forces below the limiter's",
    )
    if found:
        summary = f"a hand {found['kind']} at {found['time']:.3g} s, pushed with {found['force']} N"
        return Verdict("refuted", summary, -push, assumptions, found, figures)
    if sharing.form == "discrete" and allowed > push:
        summary = f"|U| ≤ {push:g} N never changes the river (up to {allowed:.3g} N): the dwell time is infinite"
        return Verdict("certified", summary, allowed - push, assumptions, {}, figures)
    summary = (
        f"by the bounds a push of {push:g} N may lose the hand, but a search found no hand that is lost"
        if sharing.form == "discrete"
        else "smooth weights have no hysteresis and so no dwell time, and a search found no hand that is lost"
    )
    summary += f"; another river's weight reaches {figures['rival_weight']:.2g}"
    return Verdict("unknown", summary, None, assumptions, {}, figures)
