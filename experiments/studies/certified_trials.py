"""Experiment that could refute stability certificates: hands released in MuJoCo in random rivers that are certified.

Place, curve, gains, clock and interval of hands of each river are random; in each river, random hands of the interval
are released with random offsets and velocities. ``python -m experiments.studies.certified_trials`` draws 1000.
"""

from typing import NamedTuple

import numpy as np
import tyro

from controllers.certificates.loop.hand import HandImpedance, HandRange
from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.stability import CertifiedRiver, stability
from controllers.curves.closest_point import closest_phases
from controllers.curves.trajectory import Trajectory
from experiments.certify.certified_device import phantom_device
from experiments.certify.trial_simulation import (
    FULL_CONDITIONS,
    LAP_DURATION,
    Conditions,
    LoopTrial,
    draw_trial,
    hand_path,
)
from experiments.studies.trial_onset import predicted
from sim.errors import SimError

MAX_INITIAL_FORCE = 3.0  # [N] largest initial force of the law, which motors and limiter allow anywhere
LAP_SECONDS = 4.0  # duration of a lap of the rivers; hands are released with the curve standing still
FINAL_MODE_FRACTION = 0.2  # remaining share of the slowest mode at the end of a simulation, unless that takes too long
MAX_TICKS = 2000  # [ticks] longest simulation
REST_READING_CHANGE = 5e-5  # [m] by which readings of a hand at rest change: one or two encoder counts
ASSUMED_CONDITIONS = Conditions(16)


class Certified(NamedTuple):
    """A certified river whose curve stands still, the intervals of its hands, and its largest spectral radius."""

    river: CertifiedRiver
    still: Trajectory
    hands: HandRange
    radius: float


class Release(NamedTuple):
    """Largest distance of a released hand from the curve, in the first nine tenths of the time and after them [m].

    Both are infinite if it went 5 cm away. With quantised encoders a hand held by friction moves by `slack` [m].
    """

    before: float
    after: float
    slack: float

    @property
    def diverges(self) -> bool:
        """Whether the hand ends farther from the curve than it was before."""
        return not self.after < self.before + self.slack


def draw_certified(rng: np.random.Generator) -> Certified:
    """A random river that is certified with a random interval of hands, with k_r up to 0.9 of the critical one."""
    while True:
        trial = draw_trial(rng)
        k_r = float(rng.uniform(0.05, 0.9)) * predicted(trial)
        hand = trial.hand
        hands = HandRange(*(_interval_about(number, rng) for number in (hand.mass, hand.damping, hand.stiffness)))
        lap = LAP_SECONDS / LAP_DURATION * np.asarray(trial.curve.times)
        curve = Trajectory(lap, trial.curve.positions, periodic=True)
        river = CertifiedRiver(FOLLOW_LAW, k_r, trial.b_d, float("inf"), curve, phantom_device(), trial.sampling)
        try:
            verdict = stability(river, hands.hands())
        except SimError:  # the curve leaves the workspace between the points that were checked: draw another one
            continue
        if verdict.verdict == "certified":
            return Certified(river, trial.curve, hands, float(str(verdict.figures["radius_bound"])))


def _interval_about(number: float, rng: np.random.Generator) -> tuple[float, float]:
    """A random interval about a number, of up to half the number to either side."""
    return float(number * rng.uniform(0.5, 1.0)), float(number * rng.uniform(1.0, 1.5))


def release(drawn: Certified, conditions: Conditions, rng: np.random.Generator) -> Release:
    """Simulate a hand inside the intervals from a random state at a random phase."""
    river, device, clock = drawn.river, drawn.river.device, drawn.river.sampling
    hand = HandImpedance(*(float(rng.uniform(*getattr(drawn.hands, n))) for n in ("mass", "damping", "stiffness")))
    phase = float(rng.uniform(0.0, LAP_DURATION))
    trial = LoopTrial(drawn.still, phase, river.b_d, clock, hand, np.array([1.0, 0.0, 0.0]))
    loop = trial.loop()
    while True:
        offset, velocity = rng.normal(size=3), rng.normal(size=3)
        mix = rng.uniform(0.0, 0.5 * np.pi)
        offset *= min(2e-3, MAX_INITIAL_FORCE * np.cos(mix) / river.k_r) / np.linalg.norm(offset)
        velocity *= min(0.1, MAX_INITIAL_FORCE * np.sin(mix) / river.b_d) / np.linalg.norm(velocity)
        try:
            theta = np.array(device.angles(drawn.still.point(phase) + offset)) - loop.linear.theta[0]
        except SimError:  # beyond a joint stop of the Phantom: draw another state
            continue
        break
    rate = np.linalg.solve(loop.linear.jacobian[0], velocity)
    torques = np.tile(loop.linear.weight_theta[0] @ theta, clock.whole_delay)
    state = np.concatenate([theta, rate, theta - clock.period * rate, rate, torques])
    decay = np.log(FINAL_MODE_FRACTION) / np.log(drawn.radius) if drawn.radius < 1.0 else np.inf
    ticks = int(np.clip(decay, 200, MAX_TICKS))
    path = hand_path(trial, river.k_r, ticks, conditions, state)
    if len(path) < ticks:
        return Release(np.inf, np.inf, 0.0)
    distance = closest_phases(drawn.still.packed(), path)[1]
    slack = REST_READING_CHANGE if conditions.rounded else 0.0
    return Release(float(distance[: -ticks // 10].max()), float(distance[-ticks // 10 :].max()), slack)


def certified_trials(rivers: int = 50, hands: int = 20, seed: int = 1) -> None:
    """Release hands in certified rivers, under the assumptions and with friction and rounding; print the table.

    Parameters
    ----------
    rivers, hands : int
        Number of rivers, and of hands in each.
    seed : int
        Seed of all random draws.
    """
    rng = np.random.default_rng(seed)
    found: dict[str, list[Release]] = {"inside the assumptions": [], "with Coulomb friction and rounding": []}
    clocks: list[float] = []
    for number in range(rivers):
        drawn = draw_certified(rng)
        clocks.append(drawn.river.sampling.period)
        for releases, conditions in zip(found.values(), (ASSUMED_CONDITIONS, FULL_CONDITIONS), strict=True):
            releases += [release(drawn, conditions, rng) for _ in range(hands)]
        print(f"{number + 1}/{rivers}: {sum(r.diverges for releases in found.values() for r in releases)}", flush=True)
    print(
        f"{rivers} certified rivers, periods of {1e3 * min(clocks):.2f} to {1e3 * max(clocks):.2f} ms (seed {seed})\n"
    )
    print("| | simulations | diverge | distance at the end / largest, median | worst |", "|---" * 5 + "|", sep="\n")
    for name, releases in found.items():
        shares = np.array([r.after / r.before if np.isfinite(r.before) else np.inf for r in releases])
        diverge = sum(r.diverges for r in releases)
        print(f"| {name} | {len(releases)} | {diverge} | {np.median(shares):.2g} | {shares.max():.2f} |")


if __name__ == "__main__":
    tyro.cli(certified_trials)
