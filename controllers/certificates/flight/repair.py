r"""Repair of a motion: the nearest physically feasible motion, by a nonlinear program in timing and body position.

Frame k keeps its posture; the unknowns are its duration until the next frame, h_k, and the shift of the whole body,
δ_k:

.. math:: \min_{h, \delta, p, v, \bar L} \; \frac1n \sum_k
            \Bigl(\frac{\ln h_k / h}{s_h}\Bigr)^2 + \Bigl(\frac{\lVert\delta_k\rVert}{s_\delta}\Bigr)^2
            + \text{(changes of both)} + \sum_{k \in \text{flight}} \lVert L_k h / h_k - \bar L \rVert^2 / L_{max}^2

subject to free fall in every flight, c_k + δ_k = p + v τ_k − ½ g τ_k² e_z; a unilateral floor, c̈_z ≥ −g; legs that
reach the feet in stance; and no part of a flying body below the floor.
"""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from controllers.certificates.interrupts import raise_lost_interrupts
from controllers.errors import ControllerError, ParameterError
from geometry.arrays import Array, Mask
from geometry.physics import GRAVITY

# Tried on SNU's backflip, which is repaired to a duration of 2.73 s with shifts of up to 11.4 cm. Each comment ends
# with the result for half and for twice the number.
_RATE_SCALE = 0.5  # s_h, scale of the rate's logarithm: 2.47 or 3.03 s
_SHIFT_SCALE = 0.05  # s_δ [m], scale of shifts of the body: 5.2 or 24.2 cm
_RATE_CHANGE_SCALE = 3.0  # [1/s] scale of the rate of change of the rate's logarithm: 2.92 or 2.58 s
_SHIFT_ACCELERATION_SCALE = 10.0  # [m/s²] scale of accelerations of the shift: 23.0 or 5.1 cm
_ANGULAR_MOMENTUM_WEIGHT = 0.5  # weight of changes of angular momentum: the same to 0.1 cm and 0.01 s
_RATE_RANGE = (0.15, 3.0)  # smallest and largest playing rate, relative to the recording
_MAX_LEG_EXTENSION = 0.998  # largest extension of a leg, as a fraction of its length: a knee bent by 7°


class RepairError(ControllerError):
    """A motion for which no feasible motion was found nearby."""


@dataclass(frozen=True, eq=False)
class RepairTask:
    """A stretch of n frames of a motion, to be made feasible.

    Parameters
    ----------
    fps : float
        Frames per second [1/s].
    com, angular : array, shape (n, 3)
        Centre of mass [m] and angular momentum about it [kg m²/s].
    clearance : array, shape (n,)
        Height of the lowest point of the body [m].
    flights : sequence of (int, int)
        First and last frame of every flight, both still with ground contact.
    legs : array, shape (n, 2, 3)
        Vectors from hips to ankles [m].
    standing : array of bool, shape (n, 2)
        Which foot is in stance.
    leg_length : float
        Length of a straight leg [m].
    held : (bool, bool)
        Whether the first and the last frame must stay unchanged, to join adjacent frames.

    Raises
    ------
    ParameterError
        If the shapes do not fit together, or a flight is not within the frames.
    """

    fps: float
    com: Array
    angular: Array
    clearance: Array
    flights: Sequence[tuple[int, int]]
    legs: Array
    standing: Mask
    leg_length: float
    held: tuple[bool, bool]

    def __post_init__(self) -> None:
        n = len(self.com)
        shapes = {"com": (n, 3), "angular": (n, 3), "clearance": (n,), "legs": (n, 2, 3), "standing": (n, 2)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ParameterError(f"{name} has shape {getattr(self, name).shape}; expected {shape}")
        for start, end in self.flights:
            if not 0 <= start < end < n:
                raise ParameterError(f"a flight from frame {start} to {end} is not within 0 to {n - 1}")


@dataclass(frozen=True, eq=False)
class RepairPlan:
    """Solution of a repair: new timing and shifts of a stretch of motion.

    Attributes
    ----------
    times : array, shape (n,)
        Time of each frame, from 0 on [s].
    shift : array, shape (n, 3)
        Shift of the body in each frame [m].
    falls : array, shape (flights, 2, 3)
        Position [m] and velocity [m/s] of the centre of mass at each take-off.
    iterations : int
        Iterations of the solver.
    """

    times: Array
    shift: Array
    falls: Array
    iterations: int


@contextmanager
def _matrix_indexing() -> Generator[None, None, None]:
    """Context with CasADi's own indexing mode, independent of the mode that other code has set for the process."""
    chosen = ca.GlobalOptions.getNumpyMode()
    ca.GlobalOptions.setNumpyMode(0)
    try:
        yield
    finally:
        ca.GlobalOptions.setNumpyMode(chosen)


@_matrix_indexing()
def repair(task: RepairTask) -> RepairPlan:
    """Solve the nonlinear program of this module with IPOPT.

    Raises
    ------
    RepairError
        If the solver finds no feasible motion.
    """
    n, step = len(task.com), 1.0 / task.fps
    opti = ca.Opti()
    log_steps = opti.variable(n - 1)  # ln(h_k / h): keeps durations positive without a constraint
    shift = opti.variable(n, 3)
    steps = step * ca.exp(log_steps)
    moved: Any = task.com + shift
    velocity = (moved[1:, :] - moved[:-1, :]) / ca.repmat(steps, 1, 3)
    interval_duration = (steps[1:] + steps[:-1]) / 2.0
    vertical_acceleration = (velocity[1:, 2] - velocity[:-1, 2]) / interval_duration
    jolt = (shift[2:, :] - 2.0 * shift[1:-1, :] + shift[:-2, :]) / step**2

    cost = (
        ca.sumsqr(log_steps / _RATE_SCALE)
        + ca.sumsqr(shift / _SHIFT_SCALE)
        + ca.sumsqr(jolt / _SHIFT_ACCELERATION_SCALE)
    )
    cost += ca.sumsqr((log_steps[1:] - log_steps[:-1]) / (step * _RATE_CHANGE_SCALE))
    opti.subject_to(opti.bounded(-np.log(_RATE_RANGE[1]), log_steps, -np.log(_RATE_RANGE[0])))
    airborne = np.zeros(n, dtype=bool)
    states: list[ca.MX] = []
    for start, end in task.flights:
        airborne[start + 1 : end] = True
        states.append(_free_fall(opti, task, start, end, moved, log_steps, steps))
        cost += _ANGULAR_MOMENTUM_WEIGHT * _angular_momentum_cost(opti, task, start, end, log_steps)
    for k in np.flatnonzero(~airborne[1:-1]):
        opti.subject_to(vertical_acceleration[int(k)] >= -GRAVITY)
    for k in np.flatnonzero(airborne):
        opti.subject_to(shift[int(k), 2] >= -max(float(task.clearance[k]), 0.0))
    for k, leg in np.argwhere(task.standing):
        hip_to_ankle = task.legs[k, leg]
        max_length = max(_MAX_LEG_EXTENSION * task.leg_length, float(np.linalg.norm(hip_to_ankle)))
        opti.subject_to(ca.sumsqr(hip_to_ankle[None, :] - shift[int(k), :]) <= max_length**2)
    for held, frame, interval in ((task.held[0], 0, 0), (task.held[1], n - 1, n - 2)):
        if held:
            opti.subject_to(shift[frame, :] == 0.0)
            opti.subject_to(log_steps[interval] == 0.0)
    opti.minimize(cost / n)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 500, "tol": 1e-6})
    try:
        with raise_lost_interrupts():
            solution = opti.solve()
    except RuntimeError:
        raise RepairError(
            f"no feasible neighbour of {len(task.flights)} flights in {n} frames was found "
            f"({opti.return_status()}); expected flights that timing and height can repair"
        ) from None
    return RepairPlan(
        times=np.concatenate([[0.0], np.cumsum(np.asarray(solution.value(steps)).ravel())]),
        shift=np.asarray(solution.value(shift)).reshape(n, 3),
        falls=np.array([np.asarray(solution.value(state)) for state in states]).reshape(-1, 2, 3),
        iterations=int(solution.stats()["iter_count"]),
    )


def _free_fall(
    opti: ca.Opti, task: RepairTask, start: int, end: int, moved: Any, log_steps: ca.MX, steps: ca.MX
) -> ca.MX:
    """Constrain a flight to free fall; returns its position and velocity at take-off, shape (2, 3)."""
    state = opti.variable(2, 3)
    elapsed = ca.vertcat(0, ca.cumsum(steps[start:end]))
    fall = ca.repmat(state[0, :], end - start + 1, 1) + elapsed @ state[1, :]
    opti.subject_to(moved[start : end + 1, :2] == fall[:, :2])
    opti.subject_to(moved[start : end + 1, 2] == fall[:, 2] - 0.5 * GRAVITY * elapsed**2)
    guess = _guess_fall(task.com[start : end + 1], 1.0 / task.fps)
    opti.set_initial(state, guess[:2])
    opti.set_initial(log_steps[start:end], guess[2, 0])
    return state


def _angular_momentum_cost(opti: ca.Opti, task: RepairTask, start: int, end: int, log_steps: ca.MX) -> Any:
    """Sum of squared deviations of the angular momentum from its mean in a flight, relative to its largest value."""
    mean = opti.variable(1, 3)
    air = np.arange(start + 1, end)
    scale = max(float(np.linalg.norm(task.angular[air], axis=1).max()), 1.0)
    momentum = task.angular[air] / scale / ca.repmat(ca.exp(log_steps[start + 1 : end]), 1, 3)
    opti.set_initial(mean, task.angular[air].mean(axis=0) / scale)
    return ca.sumsqr(momentum - ca.repmat(mean, len(air), 1))


def _guess_fall(com: Array, step: float) -> Array:
    """Initial guess of the take-off (position, velocity) and ln(h_k / h) of a flight, shape (3, 3)."""
    t = np.arange(len(com)) * step
    curve = np.polynomial.polynomial.polyfit(t, com, 2)
    rate = np.sqrt(GRAVITY / max(-2.0 * curve[2, 2], 1.0))
    rate = float(np.clip(rate, *_RATE_RANGE))
    return np.array([curve[0], rate * curve[1], np.full(3, -np.log(rate))])
