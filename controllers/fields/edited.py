"""Edited rivers V + U: a river V plus a field U recorded from a user's motion on it (Donald & Henle 2000, 2.3)."""

import math
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from controllers.checks import check_field_types, checked
from controllers.curves.trajectory import END, START, Trajectory, curve_point, curve_velocity
from controllers.errors import ParameterError
from controllers.fields.algebra.law import Law, Program
from controllers.fields.algebra.weights import window
from controllers.fields.follow import FollowGains, follow_at
from controllers.fields.river import River
from controllers.state import HAND_POSITION, HAND_TIME, MAX_TIME_STEP
from controllers.work_array import work_array
from geometry.arrays import Array

_NEAREST, _PERFORMANCE_TIME, _LAST_TIME, _MEMORY_SIZE = range(4)  # t* of φ', s, time of the last tick [s]
# [s] of a performance: short compared with hand motion, long enough to limit quantisation noise
_SAMPLE_INTERVAL = 0.01


@njit
def _performance_window(params: Array, performed: int, s: float, inverse_square: float, p: Array) -> float:
    """Window w(|p − φ'(s)|/ε) about the current point φ'(s) of the performance."""
    x, y, z = curve_point(params, performed, s)
    return window(((p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2) * inverse_square)


class RecordedGains(NamedTuple):
    """Parameters of `recorded_wrench`, before the packed curve φ': FOLLOW's gains, α, 1/ε², flag for pace "wait"."""

    k_r: float
    b_d: float
    river_inverse_square: float
    weight: float
    inverse_square: float
    waits: float


_GAINS_SIZE = len(RecordedGains._fields)


@njit
def recorded_wrench(params: Array, at: int, curve: int, memory: Array, slot: int, hand: Array, wrench: Array) -> None:
    """Kernel of a performance: parameters `RecordedGains` and φ', memory see `_NEAREST`."""
    gains = RecordedGains(params[at], params[at + 1], params[at + 2], params[at + 3], params[at + 4], params[at + 5])
    p, performed = hand[HAND_POSITION : HAND_POSITION + 3], at + _GAINS_SIZE
    inverse_square, start, end = gains.inverse_square, params[performed + START], params[performed + END]
    s, time = hand[HAND_TIME], hand[HAND_TIME]
    if gains.waits > 0.0:
        s = start
        if not math.isnan(memory[slot + _PERFORMANCE_TIME]):
            s = memory[slot + _PERFORMANCE_TIME]
            step = min(max(time - memory[slot + _LAST_TIME], 0.0), MAX_TIME_STEP)
            s += _performance_window(params, performed, s, inverse_square, p) * step
        # After its end, the performance returns to its start and waits there for the hand.
        s = start if s > end else s
    memory[slot + _PERFORMANCE_TIME], memory[slot + _LAST_TIME] = s, time
    wrench[:] = 0.0
    if not np.isfinite(time + p[0] + p[1] + p[2]):
        wrench[:] = np.nan
    elif start <= s <= end:
        point, speed = work_array(3), work_array(3)
        point[0], point[1], point[2] = curve_point(params, performed, s)
        speed[0], speed[1], speed[2] = curve_velocity(params, performed, s)
        follow = FollowGains(gains.k_r, gains.b_d, gains.river_inverse_square, 0.0)
        memory[slot + _NEAREST], _ = follow_at(follow, params, curve, memory[slot + _NEAREST], point, speed, wrench)
        share = gains.weight * _performance_window(params, performed, s, inverse_square, p)
        for i in range(3):
            wrench[i] *= -share


def performance(times: npt.ArrayLike, points: npt.ArrayLike) -> Trajectory:
    """Performed curve φ' of a recording: a C² spline through samples of the hand every 10 ms.

    Parameters
    ----------
    times : array_like, shape (n,)
        [s], increasing; the time of the performance counts from the first.
    points : array_like, shape (n, 3)
        p_H of the hand [m].

    Raises
    ------
    CurveError
        If the hand did not move, or the samples do not make a curve.
    """
    t, p = np.asarray(times, dtype=float), np.asarray(points, dtype=float)
    t = t - t[0]
    stride = max(1, round(_SAMPLE_INTERVAL / float(np.median(np.diff(t)))))
    samples = np.unique(np.append(np.arange(0, len(t), stride), len(t) - 1))
    return Trajectory(t[samples], p[samples])


@dataclass(frozen=True, eq=False)
class Performance(Law):
    """One performance of a user on a river as a field α U; parameters as in `Edited`."""

    river: River
    performed: Trajectory
    weight: float
    epsilon: float
    pace: Literal["clock", "wait"]

    def _compose(self) -> Program:
        river, waits = self.river, float(self.pace == "wait")
        gains = RecordedGains(
            river.drag / river.tau, river.drag, river.epsilon**-2, self.weight, self.epsilon**-2, waits
        )  # fmt: skip
        numbers = np.concatenate([gains, self.performed.packed()])
        return Program.of(self, recorded_wrench, numbers, [np.nan] * _MEMORY_SIZE, river.curve)


@dataclass(frozen=True, eq=False)
class Edited(Law):
    r"""River V plus a weighted sum of a user's performances as fields U_j.

    .. math:: V + \sum_j \alpha_j U_j, \qquad
              U_j(s, p) = w(|p - \varphi'_j(s)|/\varepsilon)\,\bigl(\dot\varphi'_j(s) - V(\varphi'_j(s))\bigr)

    U is the velocity that the user added to the river by moving along φ', so φ' is an integral curve of V + U (α = 1).
    As a force, U = −F(φ', φ̇') is the opposite of the river's force on that motion. So a hand that moves along φ' feels
    nothing, and a light hand released on φ' traces it by itself. A heavy hand departs from φ' due to its inertia, and
    no force returns it to its phase. U contains push, inertia and friction together, and needs no force sensor.

    Parameters
    ----------
    river : River
        V.
    performed : tuple of Trajectory
        φ'_j, from `performance`.
    weights : tuple of float
        α_j: 1 repeats the performance, 0.5 half of it, −1 its opposite.
    epsilon : float
        ε [m], distance from the performance at which U ends.
    pace : {"clock", "wait"}
        "clock": s is the hand's time, and U is zero after the end. "wait": s advances at the rate w(|p − φ'(s)|/ε), so
        the performance waits until the hand is near, and begins again after its end.

    Raises
    ------
    ParameterError
        If weights and performances differ in number, a number is not finite, or ε is below 1e-4 m.
    """

    river: River
    performed: tuple[Trajectory, ...]
    weights: tuple[float, ...]
    epsilon: float = 0.03
    pace: Literal["clock", "wait"] = "clock"

    def __post_init__(self) -> None:
        check_field_types(self)
        if len(self.weights) != len(self.performed) or not np.isfinite(self.weights).all():
            raise ParameterError(f"{len(self.performed)} performances need as many finite weights, got {self.weights}")
        checked("epsilon", self.epsilon, "m", least=1e-4)

    @cached_property
    def _packed_performances(self) -> tuple[Array, ...]:
        return tuple(curve.packed() for curve in self.performed)

    def _compose(self) -> Program:
        """With pace "wait", s starts at φ's start in each run."""
        laws = [
            Performance(self.river, curve, weight, self.epsilon, self.pace)
            for curve, weight in zip(self.performed, self.weights, strict=True)
        ]
        return reduce(Program.__add__, laws, self.river.program())

    def flow(self, t: float, p: Array) -> Array:
        """V + Σ α U at time t of the performance [m/s], shape (3,)."""
        total = self.river.flow(t, p)
        for weight, curve in zip(self.weights, self._packed_performances, strict=True):
            if curve[START] <= t <= curve[END]:
                share = weight * _performance_window(curve, 0, t, self.epsilon**-2, p)
                current = self.river.flow(t, np.array(curve_point(curve, 0, t)))
                total += share * (curve_velocity(curve, 0, t) - current)
        return total
