r"""What a linkage is, from a recording of it with no hand on the stylus: friction, inertia, delay, encoder offset.

With θ = reading − o, and J what the rotors and the handle add to the published inertia,

.. math:: \frac{d}{dt}\left[(M(\theta) + J)\,\dot\theta\right] - C^T\dot\theta + N(\theta) + b\,\dot\theta
          + f_c\,\mathrm{sign}\,\dot\theta = \tau(t - d)

is multiplied by smooth functions ψ of compact support and integrated (Shinbrot 1954; Preisig & Rippin, Comput. Chem.
Eng. 17, 1993: modulating functions). By parts, the derivative falls on ψ:

.. math:: \int \psi\,\tau(t-d) + \int \dot\psi\,(M + J)\,\dot\theta + \int \psi\,(C^T\dot\theta - N - b\,\dot\theta
          - f_c\,\mathrm{sign}\,\dot\theta) = 0

so no acceleration is needed, and no filter: the rate between two readings is exactly their difference, and the torque
between two commands is constant. What is left is linear in J, b, f_c, and nearly so in d and o: Gauss–Newton.

A window in which a joint comes to rest tells nothing of its friction's direction, and is left out for that joint. The
offset of θ1 changes neither weight nor inertia, so no motion tells it: it is found at the joint's stop.

The weights' torques W₂ cos θ₂ and W₃ sin θ₃ are found as well, for they are small differences of large masses: one
percent of a published mass would else be an offset of a degree. All are in units of the commanded torque: a wrong
torque constant scales them.

Intervals have two parts. One is for noise, from the estimating equations themselves (Huber 1967; Newey & West,
Econometrica 55, 1987, for windows that overlap), wide enough for all parameters at once (Bonferroni). The other is for
what the equations leave out, a torque ripple or a friction that changes from place to place, which is the same again in
every lap, so that no average takes it out: what is left beyond the encoders' noise may be a torque in the shape in time
that moves a parameter most. How noisy the encoders are is told by the readings' sixth differences, to which no motion
of a hand's or a device's bandwidth contributes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from controllers.state import Array
from models.phantom.dynamics import WEIGHT_2, WEIGHT_3, coriolis_matrix, mass_matrix
from models.phantom.parameters import PREMIUM_1_5
from sim.errors import SimError

NAMES = (
    *(f"coulomb{i}" for i in (1, 2, 3)), *(f"viscous{i}" for i in (1, 2, 3)), *(f"inertia{i}" for i in (1, 2, 3)),
    "delay", "offset2", "offset3", "weight2", "weight3",
)  # fmt: skip
"""Of the parameters: [N m], [N m s/rad], added [kg m²], [s], [rad], W₂ and W₃ [N m]."""
_DELAY, _OFFSET, _WEIGHT = 9, 10, 12

WINDOW = 0.2
"""Length of ψ [s]: its bandwidth, some 10 Hz, is above the motion's and below the encoders' noise. With 0.12 s the
noise of the rates, which are regressors, moves frictions by two standard errors towards each other."""
_HOP = 0.25  # of a window, from one to the next
_SMOOTH = 4  # readings on either side, over which the rate is taken that tells friction's direction
_SLOWEST = 0.1  # [rad/s] below which that direction is not sure
_STEPS = 12  # of Gauss–Newton
_LONGEST = 1.999  # periods of delay for which there are torques in the equations
_LAGS = 4  # windows that share noise with one: they overlap, and noise of readings is white
CONFIDENCE = 0.95
"""Of all intervals together."""
_DIFFERENCES, _GAIN = 6, 924  # and by how much that many of them amplify white noise's variance: binomial 12 over 6
_SURE = 1.5  # times the variance that the encoders explain: one of white noise is taken for no more


class Motion(NamedTuple):
    """Consecutive readings of a device, and what it was commanded after each.

    Attributes
    ----------
    clock : Array
        The device's own [s], shape (n,).
    theta : Array
        Readings [rad], shape (n, 3).
    torque : Array
        [N m], shape (n, 3).
    """

    clock: Array
    theta: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class Identified:
    """What was found.

    Attributes
    ----------
    values, margins : Array
        Of the parameters, by `NAMES`, and half of their intervals, shape (14,).
    windows : int
        That were used, all joints together.
    unexplained : float
        RMS of the torque that is left over the RMS of the torque of motion and friction.
    """

    values: Array
    margins: Array
    windows: int
    unexplained: float


def motions_of(tick: Array, clock: Array, theta: Array, torque: Array, used: npt.NDArray[np.bool_]) -> list[Motion]:
    """Stretches of consecutive ticks that are used, each at least three windows long.

    Parameters
    ----------
    tick, clock : Array
        Number of the tick, and the device's clock [s], shape (n,).
    theta, torque : Array
        Shape (n, 3).
    used : array of bool
        Whether motors were on and nobody held the stylus, shape (n,).
    """
    new = np.diff(clock) > 0.0
    joined = used[1:] & used[:-1] & (np.diff(tick) == 1.0) & new
    cuts = np.flatnonzero(np.diff(np.concatenate(([0], joined.astype(int), [0]))))
    spans = [(a, b + 1) for a, b in cuts.reshape(-1, 2)]
    return [
        Motion(clock[a:b], theta[a:b], torque[a:b]) for a, b in spans if clock[b - 1] - clock[a] > 3.0 * WINDOW
    ]  # fmt: skip


class _Equations(NamedTuple):
    """Windows of all motions: what does not depend on the nonlinear parameters, and what it takes for the rest."""

    weights: Array  # ψ at the midpoints, times the interval (windows, length)
    slopes: Array  # ψ̇, likewise
    rates: Array  # (windows, length, 3)
    smooth: Array  # the same over 2 _SMOOTH + 1 readings, for what is not linear in them
    middles: Array  # θ as read, likewise
    torque: Array
    period: float
    grain: Array  # standard deviation of the readings' noise [rad], shape (3,)
    usable: npt.NDArray[np.bool_]  # (windows, 3)
    breaks: npt.NDArray[np.bool_]  # whether a window begins a motion


def identify_linkage(motions: Sequence[Motion]) -> Identified:
    """Find what a linkage is.

    Parameters
    ----------
    motions : sequence of Motion
        With no hand on the stylus; together they should move every joint both slowly and fast.

    Raises
    ------
    SimError
        If there is too little motion to tell.
    """
    if not motions:
        raise SimError(f"no motion of {3.0 * WINDOW:g} s or more under force and without a gap; expected a longer run")
    equations = _equations(motions)
    counts = equations.usable.sum(axis=0)
    if counts.min() < 4 * len(NAMES):
        raise SimError(
            f"the joints turn steadily in {counts[0]}, {counts[1]} and {counts[2]} windows of {WINDOW} s; expected "
            f"{4 * len(NAMES)} of each: a longer, a larger or a faster motion"
        )
    values = _first_guess()
    scale = np.ones(3)
    for _ in range(_STEPS):
        left, sensitivity = _residuals(equations, values)
        scale = np.array([float(np.std(left[equations.usable[:, i], i])) for i in range(3)])
        rows, targets = _stacked(equations, sensitivity, left, scale)
        step = np.linalg.lstsq(rows, -targets, rcond=None)[0]
        values = values + step
        values[_DELAY] = np.clip(values[_DELAY], -equations.period, _LONGEST * equations.period)
    if not -equations.period < values[_DELAY] < _LONGEST * equations.period:
        raise SimError(
            f"the delay found is {values[_DELAY]:.2g} s, the end of what is looked for, {-equations.period:g} to "
            f"{_LONGEST * equations.period:.2g} s; expected motions that are faster, or a device that answers sooner"
        )
    left, sensitivity = _residuals(equations, values)
    quantile = float(ndtri(1.0 - 0.5 * (1.0 - CONFIDENCE) / len(NAMES)))
    noise = quantile * np.sqrt(np.diag(_covariance(equations, sensitivity, left, scale)))
    margins = noise + _moved_most(equations, sensitivity, scale, _left_out(equations, left, values[6:9]))
    sizes = np.sqrt(np.mean(equations.torque**2, axis=(0, 1, 2)))
    unexplained = [np.mean(left[equations.usable[:, i], i] ** 2) / sizes[i] ** 2 for i in range(3)]
    return Identified(values, margins, int(counts.sum()), float(np.sqrt(np.mean(unexplained))))


def _left_out(equations: _Equations, left: Array, inertia: Array) -> Array:
    """RMS of the torque that is left beyond what the encoders' noise explains, shape (3,) [N m].

    In a window the noise n of a reading is Σ (ψ̇ₖ₋₁ − ψ̇ₖ) M nₖ, for momentum is M times a difference of readings.
    """
    angles = tuple(np.moveaxis(equations.middles[:, len(equations.weights) // 2], -1, 0))
    rows = mass_matrix.py_func(angles)
    gain = np.linalg.norm(np.diff(equations.slopes, prepend=0.0, append=0.0)) / equations.period
    found = np.zeros(3)
    for i in range(3):
        used = equations.usable[:, i]
        by_joint = [(rows[i][j] + (inertia[i] if i == j else 0.0)) * gain * equations.grain[j] for j in range(3)]
        explained = np.sum([np.broadcast_to(part, used.shape)[used] ** 2 for part in by_joint], axis=0)
        found[i] = np.sqrt(max(0.0, float(np.mean(left[used, i] ** 2) - _SURE * np.mean(explained))))
    return found


def _moved_most(equations: _Equations, sensitivity: Array, scale: Array, torque: Array) -> Array:
    """How far torques of an RMS, shape (3,) [N m], move each parameter in the worst shape in time.

    By Cauchy and Schwarz the norm of the parameter's row of the pseudo-inverse, times √n.
    """
    rows, sizes = _stacked(equations, sensitivity, np.broadcast_to(torque, equations.usable.shape), scale)
    return np.sqrt(len(rows)) * np.linalg.norm(np.linalg.pinv(rows) * sizes, axis=1)


def _first_guess() -> Array:
    values = np.zeros(len(NAMES))
    values[:3], values[3:6] = PREMIUM_1_5.coulomb_friction, PREMIUM_1_5.viscous_friction
    values[_WEIGHT:] = WEIGHT_2, WEIGHT_3
    return values


def _equations(motions: Sequence[Motion]) -> _Equations:
    """Windows over all motions; the period is taken from the clock."""
    period = float(np.median(np.concatenate([np.diff(motion.clock) for motion in motions])))
    length, hop = round(WINDOW / period), max(1, round(_HOP * WINDOW / period))
    wiggles = np.concatenate([np.diff(motion.theta, _DIFFERENCES, axis=0) for motion in motions])
    grain = np.sqrt(np.mean(wiggles**2, axis=0) / _GAIN)
    s = (np.arange(length) + 0.5) / length
    # ψ = (8/3) sin⁴(π s)/W has a mean of 1/W, and three derivatives that end at zero.
    weights = 8.0 / 3.0 * np.sin(np.pi * s) ** 4 / length
    slopes = 8.0 / 3.0 * 4.0 * np.pi * np.sin(np.pi * s) ** 3 * np.cos(np.pi * s) / length / WINDOW
    found: list[tuple[npt.NDArray[Any], ...]] = []
    for motion in motions:
        n = len(motion.clock) - 1
        rates = np.diff(motion.theta, axis=0) / period
        middles = 0.5 * (motion.theta[1:] + motion.theta[:-1])
        box = np.ones(2 * _SMOOTH + 1) / (2 * _SMOOTH + 1)
        smooth = np.stack([np.convolve(rate, box, mode="same") for rate in rates.T], axis=1)
        starts = np.arange(_SMOOTH + 2, n - length - _SMOOTH, hop)
        at = starts[:, None] + np.arange(length)
        # The torque of the interval and of those around it, for delays of up to two periods either way.
        commands = np.stack([motion.torque[at + shift] for shift in (-2, -1, 0, 1)], axis=2)
        usable = np.min(np.abs(smooth[at]), axis=1) > _SLOWEST
        new = np.zeros(len(starts), dtype=bool)
        new[:1] = True
        found.append((rates[at], smooth[at], middles[at], commands, usable, new))
    rates, smooth, middles, commands, usable, new = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _Equations(weights, slopes, rates, smooth, middles, commands, period, grain, usable, new)


def _mean_torque(equations: _Equations, delay: float) -> Array:
    """∫ψ τ(t − d): in each interval the torque before lasts for d; with the derivative by d, shape (windows, 2, 3)."""
    whole = int(np.floor(delay / equations.period))
    share = delay / equations.period - whole
    now, before = np.clip(2 - whole, 0, 3), np.clip(1 - whole, 0, 3)
    old, new = equations.torque[:, :, before], equations.torque[:, :, now]
    blended = (1.0 - share) * new + share * old
    w = equations.weights
    return np.stack([w @ blended, w @ ((old - new) / equations.period)], axis=1)


def _mechanics(equations: _Equations, values: Array) -> Array:
    """∫ψ̇ M θ̇ + ∫ψ (Cᵀθ̇ − N) with the offset and the weights of `values`, shape (windows, 3)."""
    offset = np.array([0.0, values[_OFFSET], values[_OFFSET + 1]])
    theta1, theta2, theta3 = angles = tuple(np.moveaxis(equations.middles - offset, -1, 0))
    smooth = tuple(np.moveaxis(equations.smooth, -1, 0))
    momentum = _times(mass_matrix.py_func(angles), np.moveaxis(equations.rates, -1, 0))
    turned = _times(zip(*coriolis_matrix.py_func(angles, smooth), strict=True), smooth)
    weight = np.zeros_like(theta1), values[_WEIGHT] * np.cos(theta2), values[_WEIGHT + 1] * np.sin(theta3)
    w, v = equations.weights, equations.slopes
    return np.stack([p @ v + (c - n) @ w for p, c, n in zip(momentum, turned, weight, strict=True)], axis=1)


def _times(rows: Iterable[Any], vector: Sequence[Array] | Array) -> list[Array]:
    return [row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2] for row in rows]


def _residuals(equations: _Equations, values: Array) -> tuple[Array, Array]:
    """What is left of the equations, shape (windows, 3), and its derivatives, shape (windows, 3, 14)."""
    coulomb, viscous, inertia = values[:3], values[3:6], values[6:9]
    torque = _mean_torque(equations, float(values[_DELAY]))
    base, step = _mechanics(equations, values), 1e-5
    turning = np.einsum("k,wki->wi", equations.weights, equations.rates)
    sign = np.einsum("k,wki->wi", equations.weights, np.sign(equations.smooth))
    swing = np.einsum("k,wki->wi", equations.slopes, equations.rates)
    left = torque[:, 0] + base + inertia * swing - viscous * turning - coulomb * sign
    sensitivity = np.zeros((*left.shape, len(NAMES)))
    for i in range(3):
        sensitivity[:, i, i], sensitivity[:, i, 3 + i] = -sign[:, i], -turning[:, i]
        sensitivity[:, i, 6 + i] = swing[:, i]
    sensitivity[:, :, _DELAY] = torque[:, 1]
    for k in range(_OFFSET, len(NAMES)):
        moved = values.copy()
        moved[k] += step
        sensitivity[:, :, k] = (_mechanics(equations, moved) - base) / step
    return left, sensitivity


def _stacked(equations: _Equations, sensitivity: Array, left: Array, scale: Array) -> tuple[Array, Array]:
    """Rows of the usable equations in units of each joint's noise."""
    rows = (sensitivity / scale[:, None])[equations.usable]
    return rows, (left / scale)[equations.usable]


def _covariance(equations: _Equations, sensitivity: Array, left: Array, scale: Array) -> Array:
    """H⁻¹ S H⁻¹ with the long-run covariance S of the scores, Bartlett's weights over `_LAGS` windows."""
    usable = equations.usable
    scores = np.einsum("wi,wip->wp", np.where(usable, left / scale, 0.0), sensitivity / scale[:, None])
    rows, _ = _stacked(equations, sensitivity, left, scale)
    spread = scores.T @ scores
    motion = np.cumsum(equations.breaks)
    for lag in range(1, _LAGS + 1):
        same = (motion[lag:] == motion[:-lag])[:, None]
        product = (scores[lag:] * same).T @ scores[:-lag]
        spread += (1.0 - lag / (_LAGS + 1.0)) * (product + product.T)
    inverse = np.linalg.pinv(rows.T @ rows, hermitian=True)
    n, p = len(rows), len(NAMES)
    return inverse @ spread @ inverse * n / (n - p)
