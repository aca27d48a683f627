"""Random states of the hand about a curve, for the examination of a law; the same ones every time."""

from typing import NamedTuple

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.state import HandState
from geometry.arrays import Array

_N_STATES = 50  # states of the hand at which a law is compared with its expression
_MIN_DISTANCE, _MAX_DISTANCE = 1e-5, 5e-3  # [m] from the curve: from encoders' rounding to a fifth of a map's reach
_MIN_SPEED, _MAX_SPEED = 1e-3, 0.1  # [m/s] relative to the curve's motion, up to that of a hand that pushes
_SEED = 3


class States(NamedTuple):
    """Positions and velocities of the hand near phases of a curve: phases (n,) [s], p (n, 3) [m], v (n, 3) [m/s]."""

    phases: Array
    p: Array
    v: Array


def states_about(curve: Trajectory) -> States:
    """States near a curve, at 0 to 1.5 times its speed, with deviations of all orders of magnitude."""
    rng, n = np.random.default_rng(_SEED), _N_STATES
    # Away from the ends of an open curve, where it may stand still.
    phases = curve.start + curve.duration * rng.uniform(0.01, 0.99, size=n)
    offset, relative_velocity = (rng.normal(size=(n, 3)) for _ in range(2))
    offset *= np.geomspace(_MIN_DISTANCE, _MAX_DISTANCE, n)[rng.permutation(n), None] / np.linalg.norm(
        offset, axis=1, keepdims=True
    )
    relative_velocity *= np.geomspace(_MIN_SPEED, _MAX_SPEED, n)[rng.permutation(n), None] / np.linalg.norm(
        relative_velocity, axis=1, keepdims=True
    )
    pace = rng.choice([0.0, 0.5, 1.0, 1.5], size=(n, 1))
    return States(phases, curve.point(phases) + offset, pace * curve.velocity(phases) + relative_velocity)


def sample_hands(curve: Trajectory) -> list[HandState]:
    """The states of `states_about`, and as many on the curve, with random time, orientation, turning and switch."""
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


def state_text(p: Array, v: Array | None = None) -> str:
    """Position and, if given, velocity of a hand as text for messages."""
    place = f"p = ({', '.join(f'{1e3 * x:.3g}' for x in p)}) mm"
    return place if v is None else f"{place}, v = ({', '.join(f'{x:.3g}' for x in v)}) m/s"
