"""Stability of a river in the sampled-data loop: critical gains, delay margin, Floquet multipliers, and the verdict."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.certificates.loop.device import Device
from controllers.certificates.loop.hand import MAX_DAMPING, MAX_STIFFNESS, NO_HAND, HandImpedance
from controllers.certificates.loop.laws import SymbolicLaw
from controllers.certificates.loop.linear_loop import LinearLoop, linearise
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.sampling import MAX_DELAY_PERIODS, Sampling
from controllers.certificates.report import Verdict
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array, Mask

_MIN_STIFFNESS = 1e-3  # [N/m] at which the search for a critical gain begins
# gains of the grid before bisection; half or twice as many find the same critical gains along a curved path
GAIN_GRID = 40
# Phases of the curve at which the loop is examined; with eight times as many, critical gains are 0.1 % lower.
N_PHASES = 48
_FINE_PHASE_COUNT = 4000  # phases at which properties of the curve alone are evaluated, as in `region.remainder`
LAP_PHASES = 400  # phases for the Floquet multipliers of a lap; four times as many change their logarithm by 0.01 %
LIMITER_FACTORS = (0.05, 0.1, 0.2, 0.4, 0.7)  # factors by which the limiter may reduce a force
MAX_MARGIN_PERIODS = 16  # periods of delay at which the search for the delay margin ends


class CertifiedRiver(NamedTuple):
    """One force law closed with the device, as it is certified.

    Attributes
    ----------
    law : SymbolicLaw
        The law; of a river, or of a tube or a leash.
    k_r, b_d : float
        Its stiffness [N/m] and damping [N s/m].
    width : float
        ε or δ, radius of the tube in which it acts [m], infinite if it acts everywhere.
    curve : Trajectory
        φ, in H.
    device, sampling
        The device's dynamics; period, delay and velocity filter of the loop.
    """

    law: SymbolicLaw
    k_r: float
    b_d: float
    width: float
    curve: Trajectory
    device: Device
    sampling: Sampling

    @property
    def shear(self) -> float:
        """Largest change of the flow's speed across the curve [1/s]: ρ|φ̇|κ for a parallel flow, 0 for any other."""
        if self.law.parallel == 0.0:
            return 0.0
        phases = self.phases(_FINE_PHASE_COUNT)
        speed = np.linalg.norm(self.curve.velocity(phases), axis=1)
        return self.law.parallel * float((speed * np.where(speed > 0.0, self.curve.curvature(phases), 0.0)).max())

    def phases(self, n: int = N_PHASES) -> Array:
        """Equally spaced phases of the curve [s]: all around a closed curve, or inside the ends of an open one."""
        if self.curve.periodic:
            return self.curve.start + self.curve.duration * np.arange(n) / n
        return self.curve.start + self.curve.duration * (np.arange(n) + 0.5) / n

    def moving(self, hand: HandImpedance = NO_HAND) -> LinearLoop:
        """The loop linearised at `phases`, about motion along the curve at its own speed."""
        return linearise(self.device, self.law, self.curve, self.phases(), hand, self.width)

    def still(self, hand: HandImpedance = NO_HAND) -> LinearLoop:
        """The loop linearised at `phases`, about (practically) rest on the curve: its motion slowed down 10⁶ times."""
        return self.still_at(self.phases(), hand)

    def still_at(self, phases: Array, hand: HandImpedance = NO_HAND) -> LinearLoop:
        """As `still`, at other phases [s]."""
        slow, curve = 1e6, self.curve
        times, slow_phases = slow * np.asarray(curve.times, dtype=np.float64), slow * phases
        slow_curve = Trajectory(times, curve.positions, periodic=curve.periodic, ends=curve.ends)
        return linearise(self.device, self.law, slow_curve, slow_phases, hand, self.width)

    def loop(self, hand: HandImpedance = NO_HAND) -> SampledLoop:
        """The sampled loop about rest on the curve (`still`)."""
        return SampledLoop(self.still(hand), self.sampling)


def _bracket_onset(stable: Mask, grid: Array) -> tuple[Array, Array]:
    """Grid neighbours between which each column of `stable`, (grid, n), first becomes false; inf if never."""
    first = np.where(np.all(stable, axis=0), len(grid), np.argmin(stable, axis=0))
    ends = np.append(grid, np.inf)
    return ends[np.maximum(first - 1, 0)], ends[first]


def neighbours(values: Array, periodic: bool) -> tuple[Array, Array]:
    """Values at phases, along the last axis, and those at the next phase (cyclic for a closed curve)."""
    after = np.roll(values, -1, axis=-1)
    return (values, after) if periodic else (values[..., :-1], after[..., :-1])


def critical_stiffness(loop: SampledLoop, b_d: float, least: float = 1.0) -> Array:
    """Smallest unstable k_r ≥ `least` [N/m] at every phase, with the phase frozen, shape (n,).

    Infinite where the loop is stable up to `MAX_STIFFNESS`; `least` where it is unstable at `least` already.
    """
    return _smallest_unstable(lambda k_r: loop.radius(k_r, b_d), least, MAX_STIFFNESS)


def critical_damping(loop: SampledLoop, k_r: float, least: float) -> Array:
    """Smallest unstable b_d ≥ `least` [N s/m] at every phase, with the phase frozen, shape (n,)."""
    return _smallest_unstable(lambda b_d: loop.radius(k_r, b_d), least, MAX_DAMPING)


def _smallest_unstable(radius: Callable[[float | Array], Array], least: float, most: float) -> Array:
    """First gain between `least` and `most` with a spectral radius of 1 at each phase: a grid, then 24 bisections."""
    grid, rows = np.geomspace(least, most, GAIN_GRID), list[Mask]()
    for gain in grid:
        rows.append(radius(gain) < 1.0)
        if not np.all(rows, axis=0).any():  # every phase has its first unstable gain
            break
    low, high = _bracket_onset(np.array(rows), grid[: len(rows)])
    for _ in range(24 if (low < np.minimum(high, most)).any() else 0):
        middle = np.sqrt(low * np.minimum(high, most))
        stable = radius(middle) < 1.0
        low, high = np.where(stable, middle, low), np.where(stable, high, middle)
    return high


def delay_margin(loop: SampledLoop, k_r: float, b_d: float) -> float:
    """Additional delay [s] at which the loop first becomes unstable at some phase; inf beyond `MAX_MARGIN_PERIODS`."""
    period, delay = loop.sampling.period, loop.sampling.delay

    def stable(extra: float) -> bool:
        later = SampledLoop(loop.linear, replace(loop.sampling, delay=delay + extra))
        return bool(later.radius(k_r, b_d).max() < 1.0)

    steps = 0.25 * period * np.arange(int(4.0 * min(MAX_MARGIN_PERIODS, MAX_DELAY_PERIODS - delay / period)))
    first = next((extra for extra in steps if not stable(float(extra))), np.inf)
    if first == 0.0 or np.isinf(first):
        return float(first)
    low, high = first - 0.25 * period, first
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return float(low)


def lap_multipliers(river: CertifiedRiver, linear: LinearLoop) -> Array:
    """Floquet multipliers of a lap transverse to the curve, complex, the largest first; `linear` moves along it."""
    periods = max(1, round(river.curve.duration / river.sampling.period / LAP_PHASES))
    n = max(1, round(river.curve.duration / river.sampling.period / periods))
    return SampledLoop(linear.lap(river.curve, n), river.sampling).multipliers(river.k_r, river.b_d, periods)


class _HandResults(NamedTuple):
    """Results for the loop with each of several hands.

    Attributes
    ----------
    critical : Array
        Critical k_r at every phase [N/m], shape (hands, phases).
    bound : float
        Largest spectral radius at a phase plus its change to the next phase.
    cut : float
        Largest spectral radius with the gains reduced to one of `LIMITER_FACTORS`.
    multiplier : float or None
        Largest modulus of a Floquet multiplier of a lap; None if the hand is not carried round a closed curve.
    """

    critical: Array
    bound: float
    cut: float
    multiplier: float | None

    def worst(self, hands: Sequence[HandImpedance]) -> tuple[float, HandImpedance, int]:
        """Smallest critical k_r [N/m], its hand, and the index of its phase."""
        hand, at = divmod(int(self.critical.argmin()), self.critical.shape[1])
        least = float(self.critical[hand, at])
        return least, hands[hand] if np.isfinite(least) else NO_HAND, at

    def change(self, periodic: bool) -> float:
        """Largest change of the critical k_r from a phase to the next [N/m]."""
        here, following = neighbours(np.minimum(self.critical, MAX_STIFFNESS), periodic)
        return float(np.abs(following - here).max())


def _evaluate_hands(river: CertifiedRiver, hands: Sequence[HandImpedance]) -> _HandResults:
    """Evaluate the loop with every hand."""
    critical, multipliers, bounds, cut = list[Array](), list[float](), list[float](), 0.0
    for hand in hands:
        loop = river.loop(hand)
        critical.append(_critical_stiffness_near(loop, river))
        cut = max(cut, *(float(loop.radius(share * river.k_r, share * river.b_d).max()) for share in LIMITER_FACTORS))
        here, following = neighbours(loop.radius(river.k_r, river.b_d), river.curve.periodic)
        bounds.append(float((np.maximum(following, here) + np.abs(following - here)).max()))
        if river.curve.periodic and river.law.carries:
            multipliers.append(float(np.abs(lap_multipliers(river, river.moving(hand))[0])))
    return _HandResults(np.array(critical), max(bounds), cut, max(multipliers, default=None))


def _critical_stiffness_near(loop: SampledLoop, river: CertifiedRiver) -> Array:
    """Critical k_r [N/m] at every phase: the next above the river's own; where that is unstable, the smallest.

    Infinite where there is none.
    """
    own = max(river.k_r, _MIN_STIFFNESS)
    above = critical_stiffness(loop, river.b_d, own)
    if (above > own).all():
        return above
    below = _smallest_unstable(lambda k_r: loop.radius(k_r, river.b_d), _MIN_STIFFNESS, own)
    return np.where(above > own, above, np.minimum(below, own))


def stability(river: CertifiedRiver, hands: Sequence[HandImpedance]) -> Verdict:
    """Verdict on the river's linear stability along its curve, for each of several hands.

    Certified if, with every hand, three conditions hold. At every phase of a grid, k_r is below the critical value by
    more than the change of that value to the neighbouring phase; or, where the critical value jumps, the spectral
    radius is below 1 by more than its own change. Where the hand is carried round a closed curve, the Floquet
    multipliers of the lap lie inside the unit circle. The loop is also stable with all gains reduced by the same
    factor, as by the limiter. The margin is (critical k_r)/k_r − 1.
    """
    found = _evaluate_hands(river, hands)
    least, hand, at = found.worst(hands)
    own = max(river.k_r, _MIN_STIFFNESS)
    margin = min(least, MAX_STIFFNESS) / own - 1.0
    figures = _figures(river, found)
    assumptions = (
        "linear: small deviations, no Coulomb friction, no rounding; a force cut by the limiter is treated as one of "
        f"lower gains, down to {LIMITER_FACTORS[0]:.0%} of them, and its slew is not reached",
        f"phases: {found.critical.shape[1]} of the curve; hands: {len(hands)} of their intervals (corners and middle)",
        "the device as modelled: rigid links, ideal torque sources",
    )
    critical = f"critical k_r = {least:.4g} N/m" if least > _MIN_STIFFNESS else "no k_r is low enough"
    summary = f"k_r = {river.k_r:g} N/m, b_d = {river.b_d:g} N s/m; {critical} with {hand}"
    if least <= own:
        return Verdict("refuted", f"unstable: {summary}", margin, assumptions, counterexample(river, hand, at), figures)
    reason = _reason_not_certified(river, found, least)
    if reason is not None:
        return Verdict("unknown", f"{reason}; {summary}", margin, assumptions, {}, figures)
    return Verdict("certified", f"stable: {summary}", margin, assumptions, {}, figures)


def _reason_not_certified(river: CertifiedRiver, found: _HandResults, least: float) -> str | None:
    """Reason why a river with k_r below the least critical value is not certified; None if it is."""
    if found.multiplier is not None and found.multiplier >= 1.0:
        return f"stable with the phase held, but a multiplier of the lap is {found.multiplier:.4g}"
    if found.cut >= 1.0:
        return f"stable, but not where the limiter cuts the force: a factor of {found.cut:.4g} a period"
    change = found.change(river.curve.periodic)
    if least - change <= river.k_r and found.bound >= 1.0:
        return f"the critical k_r changes by {change:.4g} N/m from phase to phase, too coarse a grid"
    return None


def _figures(river: CertifiedRiver, found: _HandResults) -> dict[str, object]:
    """Figures of the verdict; radius, decay rate, critical damping and delay margin are for a stylus without a hand."""
    unloaded = river.loop()
    radius = unloaded.radius(river.k_r, river.b_d)
    return {
        "phases": river.phases(),
        "radius": radius,
        "radius_bound": found.bound,
        "decay_rate": -np.log(np.maximum(radius, 1e-12)) / river.sampling.period,
        "critical_stiffness": found.critical.min(axis=0),
        "critical_damping": float(critical_damping(unloaded, river.k_r, max(river.b_d, 1e-3)).min()),
        "delay_margin": delay_margin(unloaded, river.k_r, river.b_d),
        "multiplier": found.multiplier,
        "radius_cut": found.cut,
    }


def counterexample(river: CertifiedRiver, hand: HandImpedance, at: int) -> dict[str, object]:
    """Counterexample of a river that is unstable at one of its phases: phase, place, hand, state ξ and growth rate.

    Parameters
    ----------
    river : CertifiedRiver
    hand : HandImpedance
        Hand on the stylus.
    at : int
        Index of the phase.
    """
    state, growth = growing_mode(river.loop(hand), river.k_r, river.b_d, at)
    phase = float(river.phases()[at])
    return {"phase": phase, "p": river.curve.point(phase), "hand": hand, "state": state, "growth_rate": growth}


def slowest_mode(
    loop: SampledLoop, k_r: float, b_d: float, at: int, swings: bool = False
) -> tuple[complex, npt.NDArray[np.complex128]]:
    """Eigenvalue and complex state ξ of the slowest (or growing) mode at one phase; `swings`: of oscillating modes.

    The mode is scaled to an amplitude of 1 m at the tip.
    """
    values, vectors = np.linalg.eig(loop.frozen(k_r, b_d)[at])
    largest = int(np.argmax(np.where(swings & (np.abs(np.angle(values)) < 1e-3), 0.0, np.abs(values))))
    mode = loop.across[0][at] @ vectors[:, largest]
    # The complex phase is chosen so that the real part shows the tip at its largest displacement.
    displacement = loop.linear.jacobian[at] @ mode[:3]
    rotations = np.exp(1j * np.linspace(0.0, np.pi, 64, endpoint=False))
    amplitudes = np.linalg.norm((displacement * rotations[:, None]).real, axis=1)
    best = int(np.argmax(amplitudes))
    return complex(values[largest]), mode * rotations[best] / amplitudes[best]


def growing_mode(loop: SampledLoop, k_r: float, b_d: float, at: int) -> tuple[Array, float]:
    """State ξ in the slowest (or growing) mode at one phase, with the tip 1 mm off, and the growth rate [1/s]."""
    value, mode = slowest_mode(loop, k_r, b_d, at)
    return 1e-3 * mode.real, float(np.log(np.abs(value))) / loop.sampling.period


def boundary(river: CertifiedRiver, damping: Array, hand: HandImpedance = NO_HAND) -> Array:
    """Stability boundary: critical k_r [N/m], the smallest over the phases, for each b_d in `damping` [N s/m]."""
    loop = river.loop(hand)

    def critical(b_d: float) -> float:
        return float(_smallest_unstable(lambda k_r: loop.radius(k_r, b_d).max(keepdims=True), 1.0, MAX_STIFFNESS)[0])

    return np.array([critical(float(b_d)) for b_d in damping])
