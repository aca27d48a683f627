"""Hands about a curve at which a law is tried: at random, and the same ones every time."""

from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.state import Array, HandState

HANDS = 50  # hands at which a law is compared with its expression
NEAREST, FURTHEST = 1e-5, 5e-3  # [m] off the curve: from a reading's rounding to a fifth of a map's reach
SLOWEST, FASTEST = 1e-3, 0.1  # [m/s] beside the curve's own motion, up to that of a hand that pushes
_SEED = 3


class States(NamedTuple):
    """Positions and velocities of hands beside phases of a curve: phases (n,) [s], p (n, 3) [m], v (n, 3) [m/s]."""

    phases: Array
    p: Array
    v: Array


def states_about(curve: Trajectory, n: int = HANDS) -> States:
    """States beside a curve at rest, at its own pace and between, with distances and speeds of all orders."""
    rng = np.random.default_rng(_SEED)
    # Inside the ends of an open curve, where it may stand still.
    phases = curve.start + curve.duration * rng.uniform(0.01, 0.99, size=n)
    away, aside = (rng.normal(size=(n, 3)) for _ in range(2))
    away *= np.geomspace(NEAREST, FURTHEST, n)[rng.permutation(n), None] / np.linalg.norm(away, axis=1, keepdims=True)
    aside *= np.geomspace(SLOWEST, FASTEST, n)[rng.permutation(n), None] / np.linalg.norm(aside, axis=1, keepdims=True)
    pace = rng.choice([0.0, 0.5, 1.0, 1.5], size=(n, 1))
    return States(phases, curve.point(phases) + away, pace * curve.velocity(phases) + aside)


def hands_about(curve: Trajectory) -> list[HandState]:
    """The hands of `states_about`, and as many on the curve, with any time, orientation, turning and switch."""
    rng, (phases, p, v) = np.random.default_rng(_SEED), states_about(curve)
    found: list[HandState] = []
    for place, velocity in zip(
        np.concatenate([p, curve.point(phases)]), np.concatenate([v, curve.velocity(phases)]), strict=True
    ):
        q = rng.normal(size=4)
        found.append(
            HandState(
                float(rng.uniform(0.0, 10.0)), place, q / np.linalg.norm(q), velocity, rng.normal(size=3),
                bool(rng.integers(2)),
            )
        )  # fmt: skip
    return found


def told(p: Array, v: Array | None = None) -> str:
    """Position, and velocity, of a hand for messages."""
    place = f"p = ({', '.join(f'{1e3 * x:.3g}' for x in p)}) mm"
    return place if v is None else f"{place}, v = ({', '.join(f'{x:.3g}' for x in v)}) m/s"
