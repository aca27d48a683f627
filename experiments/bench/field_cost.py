"""Cost of a tick of the heaviest field: ten rivers that are all near the hand."""

import time

import numpy as np
from numba import njit

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.law import Program
from controllers.fields.algebra.program import Compiled, evaluate
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.fields.river import River
from controllers.safety.limiter import ForceLimiter, limit_force
from controllers.state import HandState
from geometry.arrays import Array


@njit
def _run_ticks(compiled: Compiled, memory: Array, limits: Array, limiter: Array, hands: Array, force: Array) -> float:
    wrench, total = np.zeros(6), 0.0
    for i in range(hands.shape[0]):
        evaluate(compiled.units, compiled.ops, compiled.params, memory, hands[i], wrench)
        limit_force(limits, limiter, wrench, force)
        total += force[0]
    return total


def heaviest_field() -> tuple[Program, Array]:
    """A limited smooth field of higher order of ten rivers that are all near; and a lap of hands in it."""
    lap = Trajectory.circle(0.05, 4.0)
    times = np.linspace(0.0, 4.0, 129)
    angle = 0.5 * np.pi * times
    rivers: list[River] = []
    for k in range(10):
        points = lap.point(times)
        points[:, 2] = 0.015 * np.sin((k % 3 + 1) * angle + k)
        points[-1] = points[0]
        rivers.append(River(Trajectory(times, points, periodic=True)))
    bundle = RiverBundle(tuple(rivers), tuple(f"river {k}" for k in range(10)))
    hands = np.array([HandState.at(lap.point(t), lap.velocity(t), t).vector() for t in np.arange(4000) * 1e-3])
    return HigherOrder(bundle, 0.09, 0.025).program().limited(8.0), hands


def tick_microseconds(program: Program, hands: Array) -> float:
    """Mean processor time of a tick of a field with the safety limiter [µs], the best of five laps of hands."""
    limiter, memory, best = ForceLimiter(1e-3), program.fresh_memory(), np.inf
    compiled, heat = program.compiled(), limiter.fresh_memory()
    for lap in range(6):
        rows = hands[:2] if lap == 0 else hands
        begin = time.thread_time()
        _run_ticks(compiled, memory, limiter.limits(), heat, rows, np.zeros(3))
        best = best if lap == 0 else min(best, time.thread_time() - begin)
    return 1e6 * best / len(hands)
