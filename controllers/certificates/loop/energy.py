r"""Energy of a river: injected energy per lap, speed of a relaxed hand, and its distance under a bounded force.

A river pushes along its tangent, so it is active by design. Of FOLLOW's force, the spring (k_r) is conservative and the
damper (b_d) injects b_d (γφ̇ − v)·v ≤ b_d |γφ̇|²/4. This bounds the power of the ideal law for any motion of the hand;
`injected` bounds what sampling, filter and rounding add for a vibrating hand. A relaxed hand moves at the speed at
which the force balances friction. A force U of the hand, |U| ≤ U_max, moves it off the curve by at most

.. math:: R = G\,\bigl(U_{max} + U_0 + k_r R\,(1 - w(R/\varepsilon)) + b_d s R\bigr), \qquad
          G = \sum_j \sigma_{max}(E\,A^j B)

with A the state matrix transverse to the curve, B its response to a force, E the displacement of the tip: G is the
peak gain of the sampled loop, the smallest number for which this holds. U_0 bounds the force that motion along the
curve needs by itself: inertia, friction and the filter's lag. The last two terms are the part of the spring that the
window removes off the curve, and the change of a parallel flow across the curve, with s = max |φ̇|κ (0 for any other
flow). A hand that starts on the curve stays within the smallest solution R: the loop is input-to-state stable.
"""

from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.device import kinematics_function
from controllers.certificates.loop.injected import BANDS, Injection, injection
from controllers.certificates.loop.linear_loop import LinearLoop, joint_motion
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.report import Verdict
from controllers.fields.algebra.weights import window
from controllers.fields.follow import PACE_RANGE
from controllers.safety.energy_tank import river_power
from geometry.arrays import Array


class Drag(NamedTuple):
    """Friction along the curve: viscous [N s/m] and Coulomb [N] at the tip, shape (n,) each."""

    viscous: Array
    coulomb: Array


def drag(river: CertifiedRiver, linear: LinearLoop) -> Drag:
    """The device's friction at the tip, along the curve."""
    along = linear.velocity / np.linalg.norm(linear.velocity, axis=1, keepdims=True)
    joints = joint_motion(linear.jacobian, along)
    return Drag(joints**2 @ np.array(river.device.viscous), np.abs(joints) @ np.array(river.device.coulomb))


def terminal_speed(river: CertifiedRiver, linear: LinearLoop) -> Array:
    """Speed [m/s] of a relaxed hand in the flow at every phase: (b_d |φ̇| − f_c)/(b_d + b), at least 0."""
    friction, pace = drag(river, linear), np.linalg.norm(linear.velocity, axis=1)
    return np.maximum(0.0, (river.b_d * pace - friction.coulomb) / (river.b_d + friction.viscous))


class PeakGain(NamedTuple):
    """Largest effect of a force of up to 1 N with any time course.

    Attributes
    ----------
    distance, force, speed : float
        Displacement [m/N], the river's force [N/N], and error of the measured velocity [m/(N s)].
    """

    distance: float
    force: float
    speed: float


def peak_gain(loop: SampledLoop, k_r: float, b_d: float) -> PeakGain:
    """Peak gains, the largest over the phases; infinite if the loop is unstable at any of them."""
    maps = loop.frozen(k_r, b_d)
    if np.abs(np.linalg.eigvals(maps)).max() >= 1.0:
        return PeakGain(*[float("inf")] * 3)
    basis, projection = loop.across
    force = projection @ loop.push
    rows = [loop.linear.jacobian @ basis[:, :3], loop.force(k_r, b_d) @ basis, loop.measured_velocity @ basis]
    gains = np.zeros((3, len(maps)))
    for _ in range(200_000):
        term = np.array([np.linalg.norm(row @ force, ord=2, axis=(1, 2)) for row in rows])
        gains += term
        if np.all(term < 1e-9 * gains):
            break
        rows = [row @ maps for row in rows]
    return PeakGain(*(float(gain.max()) for gain in gains))


def own_force(river: CertifiedRiver, linear: LinearLoop) -> Array:
    """U_0 [N] at every phase: force at the tip that motion along the curve at its own speed needs."""
    kinematics = kinematics_function(river.device).map(len(linear.phases))
    acceleration = river.curve.acceleration(linear.phases)
    bias_acceleration = np.array(kinematics(linear.theta.T, linear.rate.T)[1]).T
    joint_acceleration = joint_motion(linear.jacobian, acceleration - bias_acceleration)
    torque = np.einsum("nij,nj->ni", linear.mass, joint_acceleration)
    for i, (theta, rate) in enumerate(zip(linear.theta, linear.rate, strict=True)):
        coriolis = np.array(river.device.coriolis(theta, rate), dtype=float)
        torque[i] += coriolis @ rate + np.array(river.device.viscous) * rate
    inertia = np.linalg.norm(joint_motion(linear.jacobian.transpose(0, 2, 1), torque), axis=1)
    # Coulomb friction torques may have any sign: the worst of all combinations is taken.
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1) * np.array(river.device.coulomb)[:, None]
    stiction = np.linalg.norm(np.linalg.solve(linear.jacobian.transpose(0, 2, 1), signs[None]), axis=1).max(axis=1)
    sampling = river.sampling
    lag = sampling.delay + 1.5 * sampling.period + sampling.period * sampling.keep / (1.0 - sampling.keep)
    return inertia + stiction + river.b_d * np.linalg.norm(acceleration, axis=1) * lag


def distance_bound(river: CertifiedRiver, gain: float, force: float) -> float:
    """Smallest R [m] with R = G (U + k_r R (1 − w(R/ε)) + b_d s R); inf if there is none within the tube."""
    radius, shear = 0.0, river.b_d * river.shear
    for _ in range(500):
        share = float(window(radius * radius * river.width**-2))
        following = gain * (force + (river.k_r * (1.0 - share) + shear) * radius)
        if following > river.width:
            return float("inf")
        if abs(following - radius) < 1e-12:
            return following
        radius = following
    return float("inf")


class PushedRiver(NamedTuple):
    """A river under the push of a hand.

    Attributes
    ----------
    river : CertifiedRiver
    gain : PeakGain
    own : float
        Largest `own_force` [N].
    ceiling : float
        Force that the limiter lets through [N].
    """

    river: CertifiedRiver
    gain: PeakGain
    own: float
    ceiling: float

    @property
    def room(self) -> float:
        """Distance from the curve within which the nearest point is unique and the tube extends [m]."""
        return min(self.river.width, self.river.curve.reach)

    def bounds(self, push: float) -> tuple[float, float]:
        """Bounds of the distance [m] and of the river's force [N] for a push [N]; infinite if there are none."""
        if not np.isfinite(self.gain.distance):
            return float("inf"), float("inf")
        distance = distance_bound(self.river, self.gain.distance, push + self.own)
        return distance, self.gain.force * distance / self.gain.distance if np.isfinite(distance) else float("inf")

    def holds(self, push: float) -> bool:
        """Whether the bounds for a push [N] lie within `room` and below the ceiling."""
        distance, felt = self.bounds(push)
        return distance < self.room and felt < self.ceiling

    def most(self) -> float:
        """Largest push [N] for which `holds` is true, by bisection."""
        allowed, beyond = 0.0, self.ceiling
        for _ in range(40):
            middle = 0.5 * (allowed + beyond)
            allowed, beyond = (middle, beyond) if self.holds(middle) else (allowed, middle)
        return allowed


def energy(river: CertifiedRiver, push: float, ceiling: float) -> Verdict:
    """Verdict on the distance from the curve of a hand that pushes with at most `push` newtons, with FOLLOW.

    Certified if there is a bound within the tube and the curve's reach, where the nearest point is unique, and the
    river's force stays below `ceiling` [N]. The margin is the additional push that would be allowed [N].
    """
    moving = river.moving()
    gain = peak_gain(river.loop(), river.k_r, river.b_d)
    pushed = PushedRiver(river, gain, float(own_force(river, moving).max()), ceiling)
    executed = injection(river, moving)
    allowed, (distance, felt) = pushed.most(), pushed.bounds(push)
    figures = _power_figures(river, moving, executed) | {
        "speed_bound": float(_curve_speed(moving).max()) + push / river.b_d if river.b_d > 0.0 else None,
        "peak_gain": gain.distance,
        "force_gain": gain.force,
        "own_force": pushed.own,
        "push": push,
        "push_allowed": allowed,
        "distance_bound": distance,
        "force_bound": felt,
    }
    assumptions = (
        "power_bound is the ideal law's; the executed one gives a hand that vibrates with V m/s RMS at most "
        f"{executed.rounding:.2g} N V more below {executed.passive_below:.0f} Hz, and up to {BANDS[-1]:.0f} Hz "
        f"{executed.activity[-1]:.2g} N s/m V² besides",
        "kinematics and inertia off the curve are those on it; the hand's force is bounded and has no impedance",
        f"the limiter lets {ceiling:g} N through: the motors are not yet warm",
    )
    if pushed.holds(push):
        reason = (
            f"|U| ≤ {push:g} N on a stylus without a hand's inertia moves it by at most {1e3 * distance:.3g} mm, "
            f"the river answers with at most {felt:.3g} N; this holds up to {allowed:.3g} N"
        )
        return Verdict("certified", reason, allowed - push, assumptions, {}, figures)
    reason = (
        f"no bound for |U| ≤ {push:g} N within {1e3 * pushed.room:.3g} mm of the curve and {ceiling:g} N; "
        f"there is one up to {allowed:.3g} N"
    )
    return Verdict("unknown", reason, allowed - push, assumptions, {}, figures)


def _power_figures(river: CertifiedRiver, moving: LinearLoop, executed: Injection) -> dict[str, object]:
    """Figures on power and energy of a lap, for the ideal law and the executed one."""
    pace, speed, friction = _curve_speed(moving), terminal_speed(river, moving), drag(river, moving)
    lap, widening = river.curve.duration, PACE_RANGE[1] if river.law.parallel > 0.0 else 1.0
    return {
        "phases": river.phases(),
        "pace": pace,
        "terminal_speed": speed,
        "lap_energy": float(np.mean((friction.viscous * speed + friction.coulomb) * pace)) * lap,
        "lap_energy_bound": river.b_d * float(np.mean(pace**2)) * lap,
        "power_bound": river_power(river.b_d, widening * float(np.max(pace))),
        "passive_below": executed.passive_below,
        **{f"activity_{band:g}": found for band, found in zip(BANDS, executed.activity, strict=True)},
        "rounding_force": executed.rounding,
    }


def _curve_speed(linear: LinearLoop) -> Array:
    """|φ̇| at every phase [m/s]."""
    return np.linalg.norm(linear.velocity, axis=1)
