"""Spacetime optimisation (Witkin & Kass 1988): the feasible motion nearest to a kinematic sketch.

A motion is a quintic B-spline in the figure's `coordinates`. Its control points minimise a sum of squares over sampled
instants: the distance from the sketch, jerk, joint effort, skate of standing feet, depth of swinging feet below their
clearance, excess over joint limits, and above all the residual wrench at the root (`floor_forces`). In flight there are
no contact forces, so the same term makes the centre of mass fall with g and keeps angular momentum constant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

from geometry.arrays import Array
from models.errors import ModelError
from models.humanoid.skeleton import CONTACT_RADIUS, N_TANGENT, joint_range, torque_limit
from models.mocap.dynamics.floor_forces import Floor, RequiredWrench, residual
from models.mocap.preparation.motion_errors import JOINT_LIMIT_MARGIN
from models.mocap.preparation.stances import LOAD_DELAY
from tools.clip_authoring.coordinates import states

DEGREE = 5
_STRAIN_THRESHOLD = 0.8  # fraction of the torque limits beyond which strain counts: a fifth is left for the feedback


class Stance(NamedTuple):
    """A contact sphere that stands on the floor.

    Attributes
    ----------
    sphere : int
        Index into `FOOT_CONTACTS`.
    start, end : float
        Start and end of the stance [s].
    place : tuple of float
        x and y of its centre in W [m].
    """

    sphere: int
    start: float
    end: float
    place: tuple[float, float]


class Weights(NamedTuple):
    """Weights of the errors before squaring, per sampled instant.

    Attributes
    ----------
    force, moment : float
        Residual force, per body weight; residual moment, per body weight × metre.
    flight : float
        Factor on both while no sphere bears load.
    slip, depth : float
        Displacement of a standing sphere, depth of a swinging one below its clearance [1/m].
    limit : float
        Excess of a rotation vector over its limits [1/rad].
    effort, strain : float
        Joint torque as a fraction of its limit; the excess of this fraction over 80 %.
    sway, jerk : float
        Third derivatives of the root's position [s³/m] and of rotation vectors [s³/rad].
    """

    force: float = 20.0
    moment: float = 40.0
    flight: float = 5.0
    slip: float = 300.0
    depth: float = 200.0
    limit: float = 150.0
    effort: float = 0.4
    strain: float = 10.0
    sway: float = 3e-3
    jerk: float = 5e-5


_DEFAULT_WEIGHTS = Weights()


@dataclass(frozen=True)
class Task:
    """An optimisation problem: sketch, contact schedule and weights.

    Parameters
    ----------
    duration : float
        Duration of the optimised span [s]; half a cycle if `mirror` is given.
    intervals : int
        Knot intervals of the spline in that span.
    embed : (57, n) array
        E, which maps the free coordinates y to the 57 coordinates, u = E y.
    mirror : (n, n) array or None
        Maps y to the other half of the cycle; None for a motion that starts and ends at rest.
    speed : float
        Mean forward speed [m/s], added to the periodic part of the root's x.
    sketch : (frames, n) array
        Desired y at `times`.
    tracking : (frames, n) array
        Weights of the distance from the sketch.
    stances : sequence of Stance
        Contact schedule.
    clearance : (frames, 8) array
        Least height of the swinging spheres' lowest points above the floor [m].
    weights : Weights
        Weights of all other errors.
    """

    duration: float
    intervals: int
    embed: Array
    mirror: Array | None
    speed: float
    sketch: Array
    tracking: Array
    stances: Sequence[Stance]
    clearance: Array
    weights: Weights = _DEFAULT_WEIGHTS

    @property
    def times(self) -> Array:
        """Sampled instants [s], shape (frames,)."""
        return np.arange(len(self.sketch)) * self.duration / len(self.sketch)


class Errors(NamedTuple):
    """Errors of m states.

    Attributes
    ----------
    weighted : (m, 140) array
        Weighted residual wrench (6), slip (24), depth (8), effort (51) and excess over limits (51).
    grip : (m, 32) array
        Contact forces along the pyramids' edges [N].
    residual : (m, 6) array
        Residual wrench about the centre of mass [N, N m].
    demand : RequiredWrench
        Inverse dynamics of the states.
    """

    weighted: Array
    grip: Array
    residual: Array
    demand: RequiredWrench


class _LinearForces(NamedTuple):
    """Linearised contact forces near the sampled states: f ≈ grip + gain × (change of the residual under that grip)."""

    grip: Array
    residual: Array
    gain: Array


class Motion:
    """A motion under optimisation: y(t) is a quintic B-spline whose control points are affine in the unknowns x.

    Parameters
    ----------
    task : Task
        The optimisation problem.

    Attributes
    ----------
    unknowns : (k,) array
        x; initially the least-squares fit to the sketch.

    Raises
    ------
    ModelError
        If the arrays of the task do not fit together.
    """

    def __init__(self, task: Task) -> None:
        frames, n = task.sketch.shape
        shapes = (task.embed.shape, task.tracking.shape, task.clearance.shape)
        if shapes != ((N_TANGENT, n), (frames, n), (frames, 8)):
            raise ModelError(
                f"embed, tracking and clearance have shapes {shapes}; with a sketch of shape {task.sketch.shape} "
                f"they would be {(N_TANGENT, n)}, {(frames, n)}, {(frames, 8)}"
            )
        self.task = task
        self.floor = Floor(task.weights.moment / task.weights.force)
        count = task.intervals + DEGREE
        knots = (np.arange(count + DEGREE + 1) - DEGREE) * task.duration / task.intervals
        self._basis = BSpline(knots, np.eye(count), DEGREE)
        self._fixed_points = np.zeros((count, n))
        if task.mirror is None:
            self._fixed_points[:DEGREE], self._fixed_points[-DEGREE:] = task.sketch[0], task.sketch[-1]
            self._expand = np.eye(count * n)[:, DEGREE * n : -DEGREE * n]
        else:
            periodic = np.kron(np.eye(DEGREE, task.intervals), task.mirror)
            self._expand = np.concatenate([np.eye(task.intervals * n), periodic])
        designs = [np.kron(self._basis(task.times, order), np.eye(n)) for order in range(4)]
        self._maps = [(design @ self._expand).reshape(frames, n, -1) for design in designs]
        self._offsets = [(design @ self._fixed_points.ravel()).reshape(frames, n) for design in designs]
        self._local_unknowns = [np.flatnonzero(np.any(rows, axis=0)) for rows in self._maps[0]]
        self._standing, self._loaded = np.zeros((frames, 8), dtype=bool), np.zeros((frames, 8), dtype=bool)
        self._places = np.full((frames, 8, 3), CONTACT_RADIUS)
        for stance in task.stances:
            in_stance = (task.times >= stance.start - 1e-9) & (task.times <= stance.end + 1e-9)
            self._standing[in_stance, stance.sphere] = True
            loaded = (task.times > stance.start + LOAD_DELAY) & (task.times < stance.end - LOAD_DELAY)
            self._loaded[loaded, stance.sphere] = True
            self._places[in_stance, stance.sphere, :2] = stance.place
        misfit = (task.sketch - self._offsets[0]).ravel()
        self.unknowns: Array = np.linalg.lstsq(self._maps[0].reshape(frames * n, -1), misfit, rcond=None)[0]

    def _states(self, unknowns: Array) -> Array:
        """Free coordinates y, ẏ, ÿ at the sampled instants, shape (3, frames, n)."""
        return np.array([m @ unknowns + o for m, o in zip(self._maps[:3], self._offsets[:3], strict=True)])

    def _errors(self, y: Array, frames: npt.NDArray[np.intp], linear: _LinearForces | None) -> Errors:
        """Errors of states y (3, m, n) at the sampled instants `frames`.

        With `linear`, contact forces depend linearly on the demand, which takes a tenth of the time.
        """
        task, w = self.task, self.task.weights
        u, du, ddu = y @ task.embed.T
        u[:, 0] += task.speed * task.times[frames]
        du[:, 0] += task.speed
        demand = self.floor.demand(*states(u, du, ddu))
        standing, loaded = self._standing[frames], self._loaded[frames]
        if linear is None:
            grip = self.floor.grip(demand, loaded)
        else:
            base = linear.grip[frames]
            grip = base + np.einsum("mij,mj->mi", linear.gain[frames], residual(demand, base) - linear.residual[frames])
        missing = residual(demand, grip)
        scale = np.where(loaded.any(axis=1), 1.0, w.flight)[:, None] / self.floor.body_weight
        slip = w.slip * standing[:, :, None] * (demand.spheres - self._places[frames])
        low = demand.spheres[:, :, 2] - CONTACT_RADIUS - task.clearance[frames]
        effort = demand.torque_on(grip) / torque_limit()
        vectors, limits = u[:, 6:], joint_range().reshape(-1, 2)
        parts = [
            scale * w.force * missing[:, :3],
            scale * w.moment * missing[:, 3:],
            slip.reshape(len(u), 24),
            w.depth * np.where(standing, 0.0, np.minimum(low, 0.0)),
            w.effort * effort + w.strain * (effort - np.clip(effort, -_STRAIN_THRESHOLD, _STRAIN_THRESHOLD)),
            w.limit
            * (vectors - np.clip(vectors, limits[:, 0] + JOINT_LIMIT_MARGIN, limits[:, 1] - JOINT_LIMIT_MARGIN)),
        ]
        return Errors(np.concatenate(parts, axis=1), grip, missing, demand)

    def errors(self, unknowns: Array) -> Errors:
        """All errors that are not linear in the unknowns, at every sampled instant."""
        return self._errors(self._states(unknowns), np.arange(len(self.task.sketch)), None)

    def _linear_errors(self) -> tuple[Array, Array]:
        """Tracking and jerk, linear in the unknowns: matrix and right-hand side of A x ≈ b."""
        task, w = self.task, self.task.weights
        smoothness = np.where(np.any(task.embed[:3], axis=0), w.sway, w.jerk)
        rows = [task.tracking[:, :, None] * self._maps[0], smoothness[:, None] * self._maps[3]]
        target = [task.tracking * (task.sketch - self._offsets[0]), -smoothness * self._offsets[3]]
        return np.concatenate(rows).reshape(-1, len(self.unknowns)), np.concatenate(target).ravel()

    def _normal_equations(self, errors: Errors) -> tuple[Array, Array]:
        """Gauss–Newton matrix and gradient of the nonlinear errors: differences by y, ẏ, ÿ, then the chain rule."""
        frames, n = self.task.sketch.shape
        linear = _LinearForces(errors.grip, errors.residual, self.floor.answer(errors.demand, errors.grip))
        frame_indices = np.repeat(np.arange(frames), n)
        changes: list[Array] = []
        for order, step in enumerate((1e-5, 1e-4, 1e-3)):
            moved = np.repeat(self._states(self.unknowns), n, axis=1)
            moved[order] += step * np.tile(np.eye(n), (frames, 1))
            moved_errors = self._errors(moved, frame_indices, linear).weighted.reshape(frames, n, -1)
            changes.append((moved_errors - errors.weighted[:, None]) / step)
        matrix, gradient = np.zeros((len(self.unknowns),) * 2), np.zeros(len(self.unknowns))
        for k, local in enumerate(self._local_unknowns):
            jacobian = np.concatenate([change[k] for change in changes]).T @ np.concatenate(
                [m[k][:, local] for m in self._maps[:3]]
            )
            matrix[np.ix_(local, local)] += jacobian.T @ jacobian
            gradient[local] += jacobian.T @ errors.weighted[k]
        return matrix, gradient

    def solve(self, iterations: int, tolerance: float = 1e-4) -> list[float]:
        """Levenberg–Marquardt from the present unknowns, until a step lowers the cost by a fraction below `tolerance`.

        Returns
        -------
        list of float
            The cost before and after every iteration.
        """
        rows, target = self._linear_errors()
        fixed = rows.T @ rows
        damping = 1e-3
        errors = self.errors(self.unknowns)

        def cost(errors: Errors, unknowns: Array) -> float:
            return float(np.sum(errors.weighted**2) + np.sum((rows @ unknowns - target) ** 2))

        costs = [cost(errors, self.unknowns)]
        for _ in range(iterations):
            matrix, gradient = self._normal_equations(errors)
            matrix += fixed
            gradient += rows.T @ (rows @ self.unknowns - target)
            for _ in range(10):
                trial = self.unknowns - np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
                after = self.errors(trial)
                if cost(after, trial) < costs[-1]:
                    break
                damping *= 4
            else:
                return costs
            damping = max(damping / 4, 1e-8)
            self.unknowns, errors = trial, after
            costs.append(cost(errors, trial))
            if costs[-2] - costs[-1] < tolerance * costs[-1]:
                break
        return costs

    def coordinates(self, times: Array) -> Array:
        """The 57 coordinates at any times [s], shape (m, 57); a motion with a mirror is continued periodically."""
        points = (self._expand @ self.unknowns).reshape(self._fixed_points.shape) + self._fixed_points
        if self.task.mirror is None:
            y = self._basis(times) @ points
        else:
            half = np.floor(times / self.task.duration + 1e-9)
            y = self._basis(times - half * self.task.duration) @ points
            y = np.where((half % 2 == 1)[:, None], y @ self.task.mirror.T, y)
        u = y @ self.task.embed.T
        u[:, 0] += self.task.speed * times
        return u
