r"""Trajectory optimisation of a capture: the nearest motion that contact forces and joint torques alone can produce.

Gauss–Newton over the whole motion minimises, over the change δ(t) of `change`, the sum over sampled instants of the
squares of the errors of `motion_errors`, of the change itself, and of its third derivative.

Feet are planted together with the dynamics: planting them by inverse kinematics alone made tracking worse.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry.arrays import Array, Mask, rms
from models.humanoid.skeleton import N_TANGENT
from models.mocap.motion.clip import Clip
from models.mocap.preparation.change import DEGREE, Change, NormalEquations
from models.mocap.preparation.motion_errors import DYNAMIC_COUNT, TORQUE_COUNT, Errors, MotionErrors
from models.mocap.preparation.stances import Stances

# Iteration ends when the last 3 steps together lower the cost by less than 1 %.
_COST_TOLERANCE, _CONVERGENCE_STEPS = 0.01, 3
# Ratio of actual to predicted decrease below which damping grows (Nocedal & Wright 2006, alg. 4.1).
_MIN_DECREASE_RATIO = 0.25
_CHUNK = 64  # knot intervals whose Jacobians are in memory together: 50 MB


class Feasible(NamedTuple):
    """A motion made feasible.

    Attributes
    ----------
    clip : Clip
        The motion.
    residual : float
        RMS of the remaining residual force [body weights].
    costs : tuple of float
        Cost at first and after every iteration.
    """

    clip: Clip
    residual: float
    costs: tuple[float, ...]


def feasible(
    clip: Clip,
    schedule: Stances,
    iterations: int = 24,
    fps: float = 120.0,
    passage: bool = False,
    overlap: Array | None = None,
) -> Feasible:
    """Local optimum: the motion nearest to a clip that is feasible with a given contact schedule.

    Parameters
    ----------
    clip : Clip
        A smoothed capture, closed or open.
    schedule : Stances
        Its contact schedule, frame by frame.
    iterations : int
        Largest number of Gauss–Newton iterations.
    fps : float
        Frame rate of the result [1/s].
    passage : bool
        Whether the clip is a part of a longer motion that is unchanged beyond its ends.
    overlap : array, shape (5,), or None
        How deep each of `interpenetration.PARTS` may be in each other [m]; None if limbs are not kept apart.
    """
    change = Change(clip, passage=passage)
    errors = MotionErrors(change, schedule, overlap)
    x, costs = _Problem(change, errors).solve(iterations)
    points = x.reshape(-1, N_TANGENT)
    force = np.linalg.norm(errors.at(x, False).residual[:, :3], axis=1) / errors.floor.body_weight
    return Feasible(change.changed(points, fps), rms(force), tuple(costs))


class _Problem:
    """The least-squares problem of one clip: errors, and quadratic costs of the change."""

    def __init__(self, change: Change, errors: MotionErrors) -> None:
        self.change, self.errors = change, errors
        self.fixed = NormalEquations(change)
        tracking = errors.w.tracking() ** 2
        smoothness = np.where(np.arange(N_TANGENT) < 3, errors.w.sway, errors.w.jerk) ** 2
        for interval in range(change.intervals):
            inside = np.flatnonzero(change.first == interval)
            blocks = [
                np.einsum("ma,mb->ab", basis[inside], basis[inside]) for basis in (change.basis[0], change.basis[3])
            ]
            self.fixed.add(interval, np.kron(blocks[0], np.diag(tracking)) + np.kron(blocks[1], np.diag(smoothness)))

    def cost(self, errors: Errors, x: Array) -> float:
        return float(np.sum(errors.weighted**2) + x @ self.fixed.times(x))

    def solve(self, iterations: int) -> tuple[Array, list[float]]:
        """Levenberg–Marquardt from δ = 0, until `_CONVERGENCE_STEPS` lower the cost by `_COST_TOLERANCE` at most."""
        x = np.zeros(self.change.n_points * N_TANGENT)
        damping = 1e-4
        costs = [self.cost(self.errors.at(x, False), x)]
        for _ in range(iterations):
            system, g = self._linearise(x)
            for _ in range(12):
                step = system.solve(g, damping)
                if (cost := self.cost(self.errors.at(x - step, False), x - step)) < costs[-1]:
                    break
                damping = max(8.0 * damping, 1e-4)
            else:
                break
            # g·step is the decrease that the linearisation predicts; where contacts change, it holds only nearby.
            is_near_linear = costs[-1] - cost > _MIN_DECREASE_RATIO * (g @ step)
            damping = max(damping / 8.0, 1e-8) if is_near_linear else max(8.0 * damping, 1e-4)
            x = x - step
            costs.append(cost)
            if len(costs) > _CONVERGENCE_STEPS and costs[-1 - _CONVERGENCE_STEPS] - cost < _COST_TOLERANCE * cost:
                break
        return x, costs

    def _linearise(self, x: Array) -> tuple[NormalEquations, Array]:
        """Normal equations and half the gradient of the cost."""
        change = self.change
        system, parts = self.fixed.copy(), np.zeros((change.intervals, (DEGREE + 1) * N_TANGENT))
        for start in range(0, change.intervals, _CHUNK):
            intervals = range(start, min(start + _CHUNK, change.intervals))
            instants = np.flatnonzero((change.first >= intervals.start) & (change.first < intervals.stop))
            errors = self.errors.at(x, True, instants)
            for interval in intervals:
                block, parts[interval] = self._block(errors, instants, change.first[instants] == interval)
                system.add(interval, block)
        return system, system.gradient(parts) + self.fixed.times(x)

    def _block(self, errors: Errors, instants: npt.NDArray[np.intp], in_interval: Mask) -> tuple[Array, Array]:
        """JᵀJ and Jᵀe for the six control points of an interval, summed over its instants.

        With J = Σ_o b_o ⊗ J_o over the orders o of δ's derivatives, JᵀJ = Σ_op (b_o b_pᵀ) ⊗ (J_oᵀ J_p).
        """
        assert errors.jacobian is not None
        jacobian, weighted = errors.jacobian[in_interval], errors.weighted[in_interval]
        basis = np.stack([self.change.basis[order][instants[in_interval]] for order in range(3)], axis=1)
        # Only torques and wrench depend on velocity and acceleration, and most torques are far within their limits.
        first = 0 if weighted[:, :TORQUE_COUNT].any() else TORQUE_COUNT
        dynamic = jacobian[:, :, first:DYNAMIC_COUNT]
        inner = dynamic.transpose(0, 1, 3, 2)[:, :, None] @ dynamic[:, None]
        inner[:, 0, 0] += jacobian[:, 0, DYNAMIC_COUNT:].transpose(0, 2, 1) @ jacobian[:, 0, DYNAMIC_COUNT:]
        pairs = np.einsum("koa,kpb->abkop", basis, basis).reshape((DEGREE + 1) ** 2, -1)
        block = (pairs @ inner.reshape(-1, N_TANGENT**2)).reshape(DEGREE + 1, DEGREE + 1, N_TANGENT, N_TANGENT)
        size = (DEGREE + 1) * N_TANGENT
        slopes = (weighted[:, None, None] @ jacobian)[:, :, 0]
        return block.transpose(0, 2, 1, 3).reshape(size, size), np.einsum("koa,kon->an", basis, slopes).ravel()
