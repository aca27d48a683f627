"""Experiment that could refute a region of attraction: MuJoCo simulations from random states at and outside its edge.

Phase, hand and direction are random; the state is scaled such that V has the wanted value. Coulomb friction acts, the
encoders quantise, the river moves along its curve. The certificate claims that the distance never exceeds the region's,
and ends within the ball.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import tyro

from controllers.certificates.loop.device import kinematics_function, plant_function
from controllers.certificates.loop.hand import HandImpedance, HandRange
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.region.region import region
from controllers.certificates.report import Verdict
from controllers.curves.closest_point import closest_phases
from controllers.safety.limiter import ForceLimiter
from experiments.certify.certify import certified_rivers
from experiments.certify.trial_simulation import FULL_CONDITIONS, LoopTrial, hand_path
from experiments.config.run_config import RunConfig
from geometry.arrays import Array

HANDS = HandRange((0.25, 0.3), (6.0, 8.0), (0.0, 0.0))
TICKS = 400  # of a simulation


class Outcome(NamedTuple):
    """One simulation: largest and last distance from the curve [m]; infinite if it went 5 cm away."""

    farthest: float
    last: float


def certified_region() -> tuple[CertifiedRiver, Verdict]:
    """The river of the default run and the verdict on its region, for `HANDS`."""
    river = certified_rivers(RunConfig())[""]
    return river, region(river, HANDS, ForceLimiter(river.sampling.period).peak, Verdict("certified", "not asked"))


def simulate_from(
    river: CertifiedRiver, figures: Mapping[str, object], times: float, rng: np.random.Generator
) -> Outcome:
    """Simulate a hand of `HANDS` from a random state at which √V is `times` its value at the region's edge."""
    curve, device = river.curve, river.device
    hand = HandImpedance(*(float(rng.uniform(*getattr(HANDS, name))) for name in ("mass", "damping", "stiffness")))
    phase = float(rng.uniform(curve.start, curve.end))
    tangent = curve.velocity(phase)
    away = rng.normal(size=3)
    away -= tangent * (tangent @ away) / (tangent @ tangent)
    direction = rng.normal(size=3)
    mix = rng.uniform(0.0, 0.5 * np.pi)
    away *= np.cos(mix) * np.asarray(figures["scale"])[0] / np.linalg.norm(away)
    direction *= np.sin(mix) * np.asarray(figures["scale"])[1] / np.linalg.norm(direction)
    alpha, beta, added = (np.asarray(figures[name]) for name in ("alpha", "beta", "hand"))
    edge = times * (float(str(figures["level"])) - float(str(figures["shift"])))

    def form(size: float) -> tuple[float, Array, Array]:
        """√V of the state scaled by `size`, its joint angles and its Jacobian J."""
        theta = np.array(device.angles(curve.point(phase) + size * away))
        jacobian = np.array(kinematics_function(device)(theta, 0.0)[0])
        still = np.zeros(3)
        mass = np.array(plant_function(device)(theta, still, still, still, still, hand.numbers())[0])
        back = np.linalg.inv(jacobian)
        inertia = back.T @ mass @ back
        scale = np.asarray(figures["scale"])
        x = size * np.stack([away / scale[0], direction / scale[1], direction / scale[2]])
        value = np.einsum("ab,ai,bi->", alpha, x, x) + np.einsum("ab,ij,ai,bj->", beta, inertia, x, x)
        value += (added[0] * hand.damping + added[1] * hand.stiffness) * (x[0] @ x[0])
        return float(np.sqrt(value)), theta, jacobian

    size = 1.0
    for _ in range(6):
        size *= edge / form(size)[0]
    _, theta, jacobian = form(size)
    pace = river.b_d / (river.b_d + hand.damping) * tangent
    rate = np.linalg.solve(jacobian, pace + size * direction)
    off = theta - np.array(device.angles(curve.point(phase)))
    state = np.concatenate([off, rate, off - river.sampling.period * rate, rate])
    trial = LoopTrial(curve, phase, river.b_d, river.sampling, hand, away / max(np.linalg.norm(away), 1e-12))
    path = hand_path(trial, river.k_r, TICKS, FULL_CONDITIONS, state)
    if len(path) < TICKS:
        return Outcome(np.inf, np.inf)
    distance = closest_phases(curve.packed(), path)[1]
    return Outcome(float(distance.max()), float(distance[-50:].max()))


def region_trials(count: int = 1000, outside: int = 100, seed: int = 1) -> None:
    """Simulate from the edge of a certified region, and from 1.5, 3 and 6 times as far; print the table.

    Parameters
    ----------
    count, outside : int
        Number of simulations from the edge, and from each distance outside.
    seed : int
        Seed of all random draws.
    """
    river, verdict = certified_region()
    rng, figures = np.random.default_rng(seed), verdict.figures
    print(verdict.reason, "", sep="\n")
    print("| √V / edge | simulations | left the region | not in the ball at the end | farthest [mm] |")
    print("|---" * 5 + "|")
    most, ball = float(str(figures["largest_distance"])), float(str(figures["ball"]))
    for times, n in ((1.0, count), (1.5, outside), (3.0, outside), (6.0, outside)):
        outcomes = np.array([simulate_from(river, figures, times, rng) for _ in range(n)])
        left, missed = int(np.sum(outcomes[:, 0] > times * most)), int(np.sum(outcomes[:, 1] > ball))
        print(f"| {times:g} | {n} | {left} | {missed} | {1e3 * outcomes[:, 0].max():.2f} |", flush=True)


if __name__ == "__main__":
    tyro.cli(region_trials)
