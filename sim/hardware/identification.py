r"""Identification of a linkage from a recording without a hand on the stylus: friction, inertia, delay, offsets.

With θ = reading − o, and J the inertia that rotors and handle add to the published one,

.. math:: \frac{d}{dt}\left[(M(\theta) + J)\,\dot\theta\right] - C^T\dot\theta + N(\theta) + b\,\dot\theta
          + f_c\,\mathrm{sign}\,\dot\theta = \tau(t - d)

is multiplied by modulating functions ψ, smooth and of compact support, and integrated (Shinbrot 1954; Preisig & Rippin,
Comput. Chem. Eng. 17, 1993). Integration by parts moves the derivative to ψ:

.. math:: \int \psi\,\tau(t-d) + \int \dot\psi\,(M + J)\,\dot\theta + \int \psi\,(C^T\dot\theta - N - b\,\dot\theta
          - f_c\,\mathrm{sign}\,\dot\theta) = 0

so neither accelerations nor filters are needed: the mean rate between two readings is exactly their difference over the
period, and the torque between two commands is constant. The residual is linear in J, b, f_c, and nearly so in d and o,
so Gauss–Newton is used.

In a window in which a joint comes to rest the direction of its friction is not known; the window is left out for that
joint. The offset of θ1 affects neither gravity nor inertia, so it cannot be found from motion, only at the joint stop.

The amplitudes of the gravity torques W₂ cos θ₂ and W₃ sin θ₃ are estimated as well, since they are small differences of
large masses: an error of one percent in a published mass would otherwise appear as an offset of a degree. All
parameters are in units of the commanded torque, so a wrong torque constant scales them.

Confidence intervals are the sum of two parts. The first covers noise, from the estimating equations themselves (Huber
1967; Newey & West, Econometrica 55, 1987, for windows that overlap), simultaneously for all parameters (Bonferroni).
The second covers unmodelled torques, such as torque ripple or position-dependent friction, which repeat in every lap
and thus do not average out: the residual beyond the encoders' noise is taken as a torque with the time course that
alters a parameter most. The encoders' noise is estimated from sixth differences of the readings, to which motion within
the bandwidth of a hand or a device does not contribute.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from geometry.arrays import Array, Mask
from geometry.spans import spans
from models.phantom.dynamics import WEIGHT_2, WEIGHT_3, coriolis_matrix, mass_matrix
from models.phantom.parameters import PREMIUM_1_5
from sim.errors import SimError

NAMES = (
    *(f"coulomb{i}" for i in (1, 2, 3)), *(f"viscous{i}" for i in (1, 2, 3)), *(f"inertia{i}" for i in (1, 2, 3)),
    "delay", "offset2", "offset3", "weight2", "weight3",
)  # fmt: skip
"""Names of the parameters: Coulomb friction [N m], viscous friction [N m s/rad], added inertia [kg m²], delay [s],
encoder offsets [rad], and amplitudes of the gravity torques, W₂ and W₃ [N m]."""
_DELAY, _OFFSET, _WEIGHT = 9, 10, 12

WINDOW = 0.2
"""Length of ψ [s]: its bandwidth, some 10 Hz, is above the motion's and below that of the encoders' noise. With 0.12 s
the noise of the rates, which are regressors, moves Coulomb and viscous friction by two standard errors towards each
other."""
_HOP_FRACTION = 0.25  # offset between successive windows, as a share of their length
_HALF_WIDTH = 4  # readings on either side over which the rate that gives the direction of friction is averaged
_MIN_RATE = 0.1  # [rad/s] rate below which that direction is uncertain
_ITERATION_COUNT = 12  # Gauss–Newton steps
_MAX_DELAY = 1.999  # longest delay, in periods, for which the equations contain torques
_LAGS = round(1.0 / _HOP_FRACTION)  # following windows that share noise with one: those that begin before it ends
CONFIDENCE = 0.95
"""Joint confidence level of all intervals."""
_DIFFERENCE_ORDER, _DIFFERENCE_GAIN = 6, 924  # order; gain on the variance of white noise: 12 over 6
_NOISE_FACTOR = 1.5  # factor on the variance explained by the encoders up to which a residual counts as noise


class Motion(NamedTuple):
    """Consecutive readings of a device, and the torque commanded after each.

    Attributes
    ----------
    clock : Array
        Times by the device's own clock [s], shape (n,).
    theta : Array
        Joint angles as read [rad], shape (n, 3).
    torque : Array
        Commanded joint torques [N m], shape (n, 3).
    """

    clock: Array
    theta: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """Result of an identification.

    Attributes
    ----------
    values, margins : Array
        Parameters, by `NAMES`, and half-widths of their confidence intervals, shape (14,).
    windows : int
        Number of windows used, summed over the joints.
    unexplained : float
        RMS of the residual torque over the RMS of the commanded torque.
    """

    values: Array
    margins: Array
    windows: int
    unexplained: float


def motions_of(tick: Array, clock: Array, theta: Array, torque: Array, used: Mask) -> list[Motion]:
    """Split a recording into stretches of consecutive usable ticks, each longer than three windows.

    Parameters
    ----------
    tick, clock : Array
        Number of the tick, and the device's clock [s], shape (n,).
    theta, torque : Array
        Joint angles [rad] and torques [N m], shape (n, 3).
    used : array of bool
        Whether the motors were on and no hand held the stylus, shape (n,).
    """
    new = np.diff(clock) > 0.0
    joined = used[1:] & used[:-1] & (np.diff(tick) == 1.0) & new
    return [
        Motion(clock[a : b + 1], theta[a : b + 1], torque[a : b + 1])
        for a, b in spans(joined)
        if clock[b] - clock[a] > 3.0 * WINDOW
    ]


class _Equations(NamedTuple):
    """Data of the windows of all motions, from which residuals are computed for given parameters."""

    weights: Array  # ψ at the midpoints of the intervals, times the interval's length, shape (length,)
    slopes: Array  # ψ̇, likewise
    rates: Array  # joint rates of the intervals [rad/s], shape (windows, length, 3)
    smooth_rates: Array  # the same averaged over 2 _HALF_WIDTH + 1 intervals, for terms not linear in the rates
    midpoints: Array  # θ as read at the midpoints [rad], shape (windows, length, 3)
    torque: Array  # torques of the intervals at shifts of −2 … 1 periods [N m], shape (windows, length, 4, 3)
    period: float  # [s]
    noise: Array  # standard deviation of the readings' noise [rad], shape (3,)
    usable: Mask  # whether a joint moved throughout a window, shape (windows, 3)
    is_first: Mask  # whether a window is the first of a motion, shape (windows,)


def identify_linkage(motions: Sequence[Motion]) -> IdentificationResult:
    """Estimate the parameters of a linkage.

    Parameters
    ----------
    motions : sequence of Motion
        Motions without a hand on the stylus; together they should move every joint both slowly and fast.

    Raises
    ------
    SimError
        If there is too little motion, or the delay is at the end of the searched interval.
    """
    if not motions:
        raise SimError(f"no motion of {3.0 * WINDOW:g} s or more under force and without a gap; expected a longer run")
    equations = _make_equations(motions)
    counts = equations.usable.sum(axis=0)
    if counts.min() < 4 * len(NAMES):
        raise SimError(
            f"the joints turn steadily in {counts[0]}, {counts[1]} and {counts[2]} windows of {WINDOW} s; expected "
            f"{4 * len(NAMES)} of each: a longer, a larger or a faster motion"
        )
    values = _initial_values()
    scale = np.ones(3)
    for _ in range(_ITERATION_COUNT):
        residuals, sensitivity = _residuals(equations, values)
        scale = np.array([float(np.std(residuals[equations.usable[:, i], i])) for i in range(3)])
        rows, targets = _stack_usable(equations, sensitivity, residuals, scale)
        step = np.linalg.lstsq(rows, -targets, rcond=None)[0]
        values = values + step
        values[_DELAY] = np.clip(values[_DELAY], -equations.period, _MAX_DELAY * equations.period)
    if not -equations.period < values[_DELAY] < _MAX_DELAY * equations.period:
        raise SimError(
            f"the delay found is {values[_DELAY]:.2g} s, the end of what is looked for, {-equations.period:g} to "
            f"{_MAX_DELAY * equations.period:.2g} s; expected motions that are faster, or a device that answers sooner"
        )
    residuals, sensitivity = _residuals(equations, values)
    quantile = float(ndtri(1.0 - 0.5 * (1.0 - CONFIDENCE) / len(NAMES)))
    noise = quantile * np.sqrt(np.diag(_covariance(equations, sensitivity, residuals, scale)))
    margins = noise + _max_change(equations, sensitivity, scale, _unmodelled_torque(equations, residuals, values[6:9]))
    torque_rms = np.sqrt(np.mean(equations.torque**2, axis=(0, 1, 2)))
    unexplained = [np.mean(residuals[equations.usable[:, i], i] ** 2) / torque_rms[i] ** 2 for i in range(3)]
    return IdentificationResult(values, margins, int(counts.sum()), float(np.sqrt(np.mean(unexplained))))


def _unmodelled_torque(equations: _Equations, residuals: Array, inertia: Array) -> Array:
    """RMS of the residual torque beyond what the encoders' noise explains [N m], shape (3,).

    Noise n of the readings enters a window as Σ (ψ̇ₖ₋₁ − ψ̇ₖ) M nₖ, since momentum is M times a difference of readings.
    """
    angles = tuple(np.moveaxis(equations.midpoints[:, len(equations.weights) // 2], -1, 0))
    rows = mass_matrix.py_func(angles)
    gain = np.linalg.norm(np.diff(equations.slopes, prepend=0.0, append=0.0)) / equations.period
    rms = np.zeros(3)
    for i in range(3):
        usable = equations.usable[:, i]
        by_joint = [(rows[i][j] + (inertia[i] if i == j else 0.0)) * gain * equations.noise[j] for j in range(3)]
        explained = np.sum([np.broadcast_to(part, usable.shape)[usable] ** 2 for part in by_joint], axis=0)
        rms[i] = np.sqrt(max(0.0, float(np.mean(residuals[usable, i] ** 2) - _NOISE_FACTOR * np.mean(explained))))
    return rms


def _max_change(equations: _Equations, sensitivity: Array, scale: Array, torque: Array) -> Array:
    """Largest change of each parameter by torques of a given RMS [N m], shape (3,), with the worst time course.

    By the Cauchy–Schwarz inequality it is the norm of the parameter's row of the pseudo-inverse, times √n.
    """
    rows, torques = _stack_usable(equations, sensitivity, np.broadcast_to(torque, equations.usable.shape), scale)
    return np.sqrt(len(rows)) * np.linalg.norm(np.linalg.pinv(rows) * torques, axis=1)


def _initial_values() -> Array:
    values = np.zeros(len(NAMES))
    values[:3], values[3:6] = PREMIUM_1_5.coulomb_friction, PREMIUM_1_5.viscous_friction
    values[_WEIGHT:] = WEIGHT_2, WEIGHT_3
    return values


def _make_equations(motions: Sequence[Motion]) -> _Equations:
    """Cut all motions into windows; the period is the median difference of the clock."""
    period = float(np.median(np.concatenate([np.diff(motion.clock) for motion in motions])))
    length, hop = round(WINDOW / period), max(1, round(_HOP_FRACTION * WINDOW / period))
    differences = np.concatenate([np.diff(motion.theta, _DIFFERENCE_ORDER, axis=0) for motion in motions])
    noise = np.sqrt(np.mean(differences**2, axis=0) / _DIFFERENCE_GAIN)
    s = (np.arange(length) + 0.5) / length
    # ψ = (8/3) sin⁴(π s)/W has a mean of 1/W, and ψ and three derivatives are zero at both ends.
    weights = 8.0 / 3.0 * np.sin(np.pi * s) ** 4 / length
    slopes = 8.0 / 3.0 * 4.0 * np.pi * np.sin(np.pi * s) ** 3 * np.cos(np.pi * s) / length / WINDOW
    found: list[tuple[npt.NDArray[Any], ...]] = []
    for motion in motions:
        n = len(motion.clock) - 1
        rates = np.diff(motion.theta, axis=0) / period
        midpoints = 0.5 * (motion.theta[1:] + motion.theta[:-1])
        kernel = np.ones(2 * _HALF_WIDTH + 1) / (2 * _HALF_WIDTH + 1)
        smooth = np.stack([np.convolve(rate, kernel, mode="same") for rate in rates.T], axis=1)
        starts = np.arange(_HALF_WIDTH + 2, n - length - _HALF_WIDTH, hop)
        indices = starts[:, None] + np.arange(length)
        # The torque of the interval and of its neighbours, for delays from −1 to 2 periods.
        commands = np.stack([motion.torque[indices + shift] for shift in (-2, -1, 0, 1)], axis=2)
        usable = np.min(np.abs(smooth[indices]), axis=1) > _MIN_RATE
        is_first = np.zeros(len(starts), dtype=bool)
        is_first[:1] = True
        found.append((rates[indices], smooth[indices], midpoints[indices], commands, usable, is_first))
    rates, smooth, midpoints, commands, usable, is_first = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _Equations(weights, slopes, rates, smooth, midpoints, commands, period, noise, usable, is_first)


def _mean_torque(equations: _Equations, delay: float) -> Array:
    """∫ψ τ(t − d) and its derivative by d, shape (windows, 2, 3); in each interval the previous torque acts for d."""
    whole = int(np.floor(delay / equations.period))
    share = delay / equations.period - whole
    now, before = np.clip(2 - whole, 0, 3), np.clip(1 - whole, 0, 3)
    old, new = equations.torque[:, :, before], equations.torque[:, :, now]
    blended = (1.0 - share) * new + share * old
    w = equations.weights
    return np.stack([w @ blended, w @ ((old - new) / equations.period)], axis=1)


def _model_torque(equations: _Equations, values: Array) -> Array:
    """∫ψ̇ M θ̇ + ∫ψ (Cᵀθ̇ − N) with the offsets and gravity amplitudes of `values`, shape (windows, 3)."""
    offset = np.array([0.0, values[_OFFSET], values[_OFFSET + 1]])
    theta1, theta2, theta3 = angles = tuple(np.moveaxis(equations.midpoints - offset, -1, 0))
    smooth_rates = tuple(np.moveaxis(equations.smooth_rates, -1, 0))
    momentum = _multiply(mass_matrix.py_func(angles), np.moveaxis(equations.rates, -1, 0))
    coriolis = _multiply(zip(*coriolis_matrix.py_func(angles, smooth_rates), strict=True), smooth_rates)
    gravity = np.zeros_like(theta1), values[_WEIGHT] * np.cos(theta2), values[_WEIGHT + 1] * np.sin(theta3)
    w, v = equations.weights, equations.slopes
    return np.stack([p @ v + (c - n) @ w for p, c, n in zip(momentum, coriolis, gravity, strict=True)], axis=1)


def _multiply(rows: Iterable[Any], vector: Sequence[Array] | Array) -> list[Array]:
    return [row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2] for row in rows]


def _residuals(equations: _Equations, values: Array) -> tuple[Array, Array]:
    """Residuals of the equations, shape (windows, 3), and their derivatives, shape (windows, 3, 14)."""
    coulomb, viscous, inertia = values[:3], values[3:6], values[6:9]
    torque = _mean_torque(equations, float(values[_DELAY]))
    model, step = _model_torque(equations, values), 1e-5
    viscous_term = np.einsum("k,wki->wi", equations.weights, equations.rates)
    coulomb_term = np.einsum("k,wki->wi", equations.weights, np.sign(equations.smooth_rates))
    inertia_term = np.einsum("k,wki->wi", equations.slopes, equations.rates)
    residuals = torque[:, 0] + model + inertia * inertia_term - viscous * viscous_term - coulomb * coulomb_term
    sensitivity = np.zeros((*residuals.shape, len(NAMES)))
    for i in range(3):
        sensitivity[:, i, i], sensitivity[:, i, 3 + i] = -coulomb_term[:, i], -viscous_term[:, i]
        sensitivity[:, i, 6 + i] = inertia_term[:, i]
    sensitivity[:, :, _DELAY] = torque[:, 1]
    for k in range(_OFFSET, len(NAMES)):
        shifted = values.copy()
        shifted[k] += step
        sensitivity[:, :, k] = (_model_torque(equations, shifted) - model) / step
    return residuals, sensitivity


def _stack_usable(equations: _Equations, sensitivity: Array, residuals: Array, scale: Array) -> tuple[Array, Array]:
    """Derivatives and residuals of the usable equations, in units of each joint's noise `scale`."""
    rows = (sensitivity / scale[:, None])[equations.usable]
    return rows, (residuals / scale)[equations.usable]


def _covariance(equations: _Equations, sensitivity: Array, residuals: Array, scale: Array) -> Array:
    """Sandwich covariance H⁻¹ S H⁻¹, S the long-run covariance of the scores by Bartlett weights over `_LAGS` lags."""
    usable = equations.usable
    scores = np.einsum("wi,wip->wp", np.where(usable, residuals / scale, 0.0), sensitivity / scale[:, None])
    rows, _ = _stack_usable(equations, sensitivity, residuals, scale)
    score_covariance = scores.T @ scores
    motion = np.cumsum(equations.is_first)
    for lag in range(1, _LAGS + 1):
        same = (motion[lag:] == motion[:-lag])[:, None]
        product = (scores[lag:] * same).T @ scores[:-lag]
        score_covariance += (1.0 - lag / (_LAGS + 1.0)) * (product + product.T)
    inverse = np.linalg.pinv(rows.T @ rows, hermitian=True)
    n, p = len(rows), len(NAMES)
    return inverse @ score_covariance @ inverse * n / (n - p)
