"""Onset of instability of a trial's loop: predicted from the linear loop, and observed in its simulation."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from scipy.optimize import brentq

from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import critical_stiffness, slowest_mode
from experiments.certify.certified_device import phantom_device
from experiments.certify.trial_simulation import Conditions, LoopTrial, simulate
from geometry.arrays import Array

MAX_GROWTH = 20.0  # ratio to the initial distance beyond which a motion is no longer taken to be linear


def predicted(trial: LoopTrial) -> float:
    """Critical k_r [N/m] of the linear loop."""
    return float(critical_stiffness(trial.loop(), trial.b_d)[0])


def growth(path: Array) -> float:
    """Largest modulus of the modes of a free linear motion, per sample, by the matrix pencil method.

    Parameters
    ----------
    path : Array
        Samples, shape (n, 3); modes that contribute less than 1e-4 of the strongest one are taken for noise.
    """
    stride = max(1, len(path) // 200)
    samples = path[::stride]
    window = len(samples) // 2
    rows = len(samples) - window
    hankel = np.vstack([samples[i : i + rows].T for i in range(window + 1)])
    past, future = hankel[:-3], hankel[3:]
    u, sizes, v = np.linalg.svd(past, full_matrices=False)
    rank = int(np.sum(sizes > 1e-6 * sizes[0]))
    reduced = (u[:, :rank].T @ future @ v[:rank].T) / sizes[:rank]
    modes = np.linalg.eigvals(reduced)
    powers = modes[None, :] ** np.arange(len(samples))[:, None]
    parts = np.linalg.lstsq(powers, samples.astype(complex), rcond=None)[0]
    sizes = np.linalg.norm(parts, axis=1) * np.linalg.norm(powers, axis=0)
    return float(np.abs(modes[sizes > 1e-4 * sizes.max()]).max() ** (1.0 / stride))


def observed_growth(trial: LoopTrial, k_r: float, conditions: Conditions) -> float:
    """Rate at which the slowest mode grows [1/s], from a simulation of up to 0.2 s."""
    period = trial.sampling.period
    path = simulate(trial, k_r, int(np.clip(0.2 / period, 120, 500)), conditions)
    size = np.linalg.norm(path, axis=1)
    beyond = np.flatnonzero(size > MAX_GROWTH * conditions.start)
    end = int(beyond[0]) if len(beyond) else len(path)
    # The first quarter is left out, as fast modes decay in it. Differences are taken, as the error of the weight
    # compensation leaves a constant offset, which is not a mode.
    return float(np.log(growth(np.diff(path[end // 4 : end], axis=0)))) / period


def observed(trial: LoopTrial, guess: float, conditions: Conditions) -> float:
    """Critical k_r [N/m] of the simulation, between half and twice a guess; NaN if the onset is not in this range."""

    def rate(log_k: float) -> float:
        return observed_growth(trial, float(np.exp(log_k)), conditions)

    return _sign_change(rate, guess)


def _sign_change(rate: Callable[[float], float], guess: float) -> float:
    """Gain near a guess at which a rate, given as a function of the gain's logarithm, changes its sign upwards."""
    for width in (1.1, 1.4, 2.0):
        low, high = float(np.log(guess / width)), float(np.log(guess * width))
        if rate(low) < 0.0 < rate(high):
            return float(np.exp(cast(float, brentq(rate, low, high, xtol=1e-3))))
    return float("nan")


class FrictionOnset(NamedTuple):
    """Critical k_r [N/m] predicted with Coulomb friction, and the loop with the equivalent damping."""

    k_r: float
    loop: SampledLoop


def with_friction(trial: LoopTrial, amplitude: float) -> FrictionOnset:
    """Onset predicted with Coulomb friction, for a motion of a given amplitude across the curve [m].

    Describing function: friction f_c on a joint that oscillates with rate amplitude Ω is equivalent to the damping
    4 f_c/(π Ω). Ω follows from the mode at the boundary; a few iterations converge.
    """
    frictionless, device = trial.loop(), phantom_device()
    loop, k_r = frictionless, predicted(trial)
    for _ in range(12):
        rates = amplitude * np.abs(slowest_mode(loop, k_r, trial.b_d, 0, swings=True)[1][3:6])
        damping = 4.0 * np.array(device.coulomb) / (np.pi * np.maximum(rates, 1e-9))
        linear = replace(frictionless.linear, inverse_rate=frictionless.linear.inverse_rate + np.diag(damping))
        loop = SampledLoop(linear, trial.sampling)
        k_r = float(np.sqrt(k_r * min(critical_stiffness(loop, trial.b_d)[0], 4.0 * k_r)))
    return FrictionOnset(k_r, loop)


def observed_with_friction(trial: LoopTrial, guess: FrictionOnset, amplitude: float, conditions: Conditions) -> float:
    """Critical k_r [N/m] of the simulation for a motion of a given amplitude [m], which neither grows nor decays.

    Each simulation begins in the slowest mode at that amplitude; its first two oscillations are compared.
    """

    def rate(log_k: float) -> float:
        k_r = float(np.exp(log_k))
        value, mode = slowest_mode(guess.loop, k_r, trial.b_d, 0, swings=True)
        samples = max(4, round(2.0 * np.pi / max(abs(np.angle(value)), 1e-3)))
        path = simulate(trial, k_r, 2 * samples, conditions, amplitude * mode.real)
        if len(path) < 2 * samples:
            return 1.0
        # The second oscillation may vanish, if the hand comes to rest on the curve.
        return float(np.log(max(np.linalg.norm(path[samples:]), 1e-12) / np.linalg.norm(path[:samples])))

    return _sign_change(rate, guess.k_r)
