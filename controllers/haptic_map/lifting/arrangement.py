r"""Arrangement of curves round the z axis: sites (r_i(θ), z_i(θ)) in a rectangle, optimised jointly.

.. math:: E = \sum_{i<j} \Bigl\langle w\, \frac{(D_{ij} - T_{ij})^2}{\bar T^2}
          + \Bigl(1 - \frac{D_{ij}}{S_{ij}}\Bigr)_+^2 + v\, |q_i' - q_j'|^2 \Bigr\rangle
          + \sum_i \langle (1 + \dot\theta_i^4/\omega^4)\, |q_i''|^2 + limits \rangle

D is the distance of two sites at an angle, T = κ d the distance of the two poses there scaled to the size of the
rectangle (multidimensional scaling, at every angle and smooth in it): a millimetre of hand motion then changes the
figure equally everywhere, so h_* is well conditioned. At a transition T falls to the approach, and v makes the curves
parallel; elsewhere S keeps them apart. The bending term grows with θ̇: where the radius changes, springs and filters
track the tangential acceleration 2 θ̇² r' with an error, which shifts the hand's angle and with it the clip's phase.
`limits` penalises excessive speed and acceleration. Sites are periodic cubic B-splines whose control points lie in the
rectangle, hence so do the sites.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_array

from controllers.haptic_map.lifting.layouts import on_lattice, scaled
from controllers.haptic_map.lifting.room import Rectangle
from controllers.haptic_map.lifting.transitions import Transition
from geometry.arrays import Array
from geometry.easing import cubic_steps

N_ROWS = 64  # control points round the lap
_SAMPLES_PER_ROW = 3
N_ANGLES = N_ROWS * _SAMPLES_PER_ROW  # angles at which the energy is evaluated
# The sensitivities of the constants in this folder were found with walk, run, jump and backflip, in a room with r from
# 20 mm on, and 200 iterations of the optimiser. Distances of two clips are those of their curves at the transition.

# [rad] distance from a transition within which two curves may be nearer than the separation. With half of it walk and
# run come within 12.7 mm instead of 10.1, jump and backflip within 8.7 instead of 5.0.
TRANSITION_WINDOW = 0.9
# Target distance of the most different motions, as a fraction of the rectangle's diagonal. With 0.6 walk and run come
# within 5.6 mm of each other, with 0.8 within 10.1, with 1.0 within 12.9; h_* changes by 11, 12 and 10 % per
# millimetre.
_FILL_FRACTION = 0.8
# Least distance at a transition, as a fraction of the target distance κ d of the poses. Walk and run come within 10.1
# mm, with half of it 7.4 and with twice 15.1; at nine of ten places h_* changes by at most 66, 69 and 55 % per
# millimetre.
_MIN_DISTANCE_RATIO = 0.2
# Weights of the terms. Half or twice the separation weight changes the distances at the transitions (5.0 and 10.1 mm)
# by 0.2 mm, the tangent weight by 0.4, the approach and bend weights by 1.8; the condition number of h_* half way
# between two curves changes by 0.6 of 22.7.
_SEPARATION_WEIGHT, _APPROACH_WEIGHT, _TANGENT_WEIGHT, _BEND_WEIGHT, _LIMIT_WEIGHT = 40.0, 250.0, 0.7, 0.015, 40.0
# [rad/s] ω: a captured walk with a residual of 1.7 % of weight has 4.7 % on its curve, with ω = 3 rad/s 11 %
_BEND_RATE = 2.0
_LENGTH_UNIT = 0.02  # [m] unit of length of slopes and bends in the energy
# Safety factor on the separation and the limits, for angles between the samples. Curves come within 5.0 mm of each
# other, with 1.0 within 4.5 and with 1.2 within 5.6.
_SAFETY_FACTOR = 1.1
# More than until convergence: walk, run, jump and backflip take 1200 to 3800, all nine clips 4400. With 200 the result
# depended on the start, and with it on the processor's rounding: pushed from walk into run the figure had 8.9 to 15.3 %
# of weight, and fell with two starts of twenty; converged it has 8.7 or 8.8 %.
_MAX_ITERATIONS = 5000


@dataclass(frozen=True, eq=False)
class Task:
    """Data of an arrangement problem.

    Attributes
    ----------
    rectangle : Rectangle
    separation : float
        Least distance of two curves away from their transitions [m].
    approach : float
        Distance of two curves at a transition between equal poses [m].
    speed, acceleration : float
        Largest of the hand along a curve [m/s, m/s²].
    distance : Array, shape (N_ANGLES, n, n)
        Between poses [m].
    transitions : list of Transition
    rate, change : Array, shape (N_ANGLES, n)
        θ̇ and θ̈ of each clip at its own pace [rad/s, rad/s²].
    """

    rectangle: Rectangle
    separation: float
    approach: float
    speed: float
    acceleration: float
    distance: Array
    transitions: list[Transition]
    rate: Array
    change: Array

    @property
    def scale(self) -> float:
        """κ: ratio of distances in the rectangle to distances of poses."""
        size = float(np.linalg.norm(self.rectangle.high - self.rectangle.low))
        return _FILL_FRACTION * size / max(float(self.distance.mean(axis=0).max()), 1e-9)

    def targets(self) -> tuple[Array, Array, Array]:
        """T, S and w of the energy, each of shape (N_ANGLES, n, n)."""
        wanted = np.maximum(self.scale * self.distance, _SAFETY_FACTOR * self.separation)
        least = np.full(wanted.shape, _SAFETY_FACTOR * self.separation)
        weight = np.ones(wanted.shape)
        for first, second, near in self.windows():
            nearest = np.maximum(self.approach, _MIN_DISTANCE_RATIO * self.scale * self.distance[:, first, second])
            target = nearest + (wanted[:, first, second] - nearest) * near
            floor = self.approach + (least[:, first, second] - self.approach) * near
            for i, j in ((first, second), (second, first)):
                wanted[:, i, j] = target
                least[:, i, j] = np.minimum(least[:, i, j], floor)
                weight[:, i, j] += _APPROACH_WEIGHT * np.maximum(1.0 - 3.0 * near, 0.0)
        return wanted, least, weight

    def windows(self) -> list[tuple[int, int, Array]]:
        """Pairs with a transition, and a smooth step of the angle, (N_ANGLES,): 0 at it, 1 from the window on."""
        angle = 2.0 * np.pi * np.arange(N_ANGLES) / N_ANGLES
        found: list[tuple[int, int, Array]] = []
        for at in self.transitions:
            away = np.abs(np.remainder(angle - at.angle + np.pi, 2.0 * np.pi) - np.pi)
            found.append((at.first, at.second, cubic_steps(away / TRANSITION_WINDOW)))
        return found

    def hand_motion(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of the hand along r, θ and z, each (3, N_ANGLES, n); see `evaluate_sites`."""
        r, dr, dz, ddr, ddz = q[..., 0], dq[..., 0], dq[..., 1], ddq[..., 0], ddq[..., 1]
        w, a = self.rate, self.change
        velocity = np.stack([w * dr, w * r, w * dz])
        return velocity, np.stack([w * w * (ddr - r) + a * dr, 2.0 * w * w * dr + a * r, w * w * ddz + a * dz])


class _SplineMatrices(NamedTuple):
    """Matrices (N_ANGLES, N_ROWS) that give value and derivatives by θ of periodic cubic B-splines at the samples."""

    value: csr_array
    slope: csr_array
    bend: csr_array


def _spline_matrices() -> _SplineMatrices:
    matrices = np.zeros((3, N_ANGLES, N_ROWS))
    rate = N_ROWS / (2.0 * np.pi)
    for k in range(N_ANGLES):
        row, u = k // _SAMPLES_PER_ROW, (k % _SAMPLES_PER_ROW) / _SAMPLES_PER_ROW
        value = [(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]
        slope = [-3 * (1 - u) ** 2, 9 * u**2 - 12 * u, -9 * u**2 + 6 * u + 3, 3 * u**2]
        bend = [6 * (1 - u), 18 * u - 12, -18 * u + 6, 6 * u]
        columns = (row + np.arange(-1, 3)) % N_ROWS
        for matrix, numbers, unit in zip(matrices, (value, slope, bend), (1.0, rate, rate**2), strict=True):
            matrix[k, columns] = unit * np.array(numbers) / 6.0
    return _SplineMatrices(*(csr_array(matrix) for matrix in matrices))


_MATRICES = _spline_matrices()
_SLOPE_UNIT = N_ANGLES * _LENGTH_UNIT**2


def sites_of(controls: Array) -> Array:
    """Sites at `N_ROWS` equal steps of θ, shape (N_ROWS, n, 2), from control points of the same shape."""
    return evaluate_sites(controls)[0][::_SAMPLES_PER_ROW]


def evaluate_sites(controls: Array) -> tuple[Array, Array, Array]:
    """Sites at the samples of the lap and their first and second derivatives by θ, each (N_ANGLES, n, 2)."""
    flat = controls.reshape(N_ROWS, -1)
    q, dq, ddq = ((matrix @ flat).reshape(N_ANGLES, -1, 2) for matrix in _MATRICES)
    return q, dq, ddq


class Energy:
    """E and its gradient by the control points."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._target, self._min_distance, self._weight = task.targets()
        n = task.distance.shape[1]
        self._pairs = i, j = np.triu_indices(n, 1)
        self._incidence = np.equal.outer(np.arange(n), i).astype(float) - np.equal.outer(np.arange(n), j)
        square = self._target[:, self._pairs[0], self._pairs[1]] ** 2
        self._mean_square = float(square.mean()) if n > 1 else 1.0

    def __call__(self, flat: Array) -> tuple[float, Array]:
        """E and its gradient at control points (N_ROWS · n · 2,)."""
        task = self._task
        controls = flat.reshape(N_ROWS, -1, 2)
        q, dq, ddq = evaluate_sites(controls)
        apart, g_q = self._distance_terms(q)
        stiff = _BEND_WEIGHT / _SLOPE_UNIT * (1.0 + (task.rate[..., None] / _BEND_RATE) ** 4)
        bend, g_ddq = (stiff * ddq**2).sum(), 2.0 * stiff * ddq
        slant, g_slant = self._parallel_term(dq)
        w, a = task.rate, task.change
        v, u = task.hand_motion(q, dq, ddq)
        fast, g_v = _limit_penalty(v, task.speed / _SAFETY_FACTOR)
        hard, g_u = _limit_penalty(u, task.acceleration / _SAFETY_FACTOR)
        g_dq = np.stack([w * g_v[0] + a * g_u[0] + 2.0 * w * w * g_u[1], w * g_v[2] + a * g_u[2]], axis=-1)
        g_dq = g_dq + g_slant
        g_q = g_q + np.stack([w * g_v[1] - w * w * g_u[0] + a * g_u[1], np.zeros_like(w)], axis=-1)
        g_ddq = g_ddq + np.stack([w * w * g_u[0], w * w * g_u[2]], axis=-1)
        gradient = np.zeros((N_ROWS, controls.shape[1] * 2))
        for matrix, g in zip(_MATRICES, (g_q, g_dq, g_ddq), strict=True):
            gradient += matrix.T @ g.reshape(N_ANGLES, -1)
        return float(apart + slant + bend + fast + hard), gradient.ravel()

    def _distance_terms(self, q: Array) -> tuple[float, Array]:
        """Stress and separation terms, and their gradient by the sites (N_ANGLES, n, 2)."""
        i, j = self._pairs
        if not len(i):
            return 0.0, np.zeros_like(q)
        step = q[:, i] - q[:, j]
        distance = np.sqrt((step**2).sum(axis=2) + 1e-12)
        error = distance - self._target[:, i, j]
        weight = self._weight[:, i, j] / self._mean_square
        short = np.maximum(1.0 - distance / self._min_distance[:, i, j], 0.0)
        share = 1.0 / N_ANGLES
        total = share * (weight * error**2).sum() / q.shape[1] + share * _SEPARATION_WEIGHT * (short**2).sum()
        slope = share * 2.0 * (weight * error / q.shape[1] - _SEPARATION_WEIGHT * short / self._min_distance[:, i, j])
        pull = (slope / distance)[..., None] * step
        return float(total), self._incidence @ pull

    def _parallel_term(self, dq: Array) -> tuple[float, Array]:
        """Penalty of curves that are not parallel where they meet, and its gradient by the slopes."""
        total, gradient = 0.0, np.zeros_like(dq)
        for first, second, near in self._task.windows():
            meets = _TANGENT_WEIGHT * np.maximum(1.0 - 3.0 * near, 0.0)[:, None] / _SLOPE_UNIT
            step = dq[:, first] - dq[:, second]
            total += float((meets * step**2).sum())
            gradient[:, first] += 2.0 * meets * step
            gradient[:, second] -= 2.0 * meets * step
        return total, gradient


def _limit_penalty(v: Array, limit: float) -> tuple[float, Array]:
    """Penalty of vectors (3, N_ANGLES, n) longer than allowed, and its gradient."""
    size = np.sqrt((v**2).sum(axis=0) + 1e-24)
    over = np.maximum(size / limit - 1.0, 0.0)
    slope = 2.0 * _LIMIT_WEIGHT / N_ANGLES * (over / (limit * size)) * v
    return _LIMIT_WEIGHT * float((over**2).sum()) / N_ANGLES, slope


def arrange(task: Task, rng: np.random.Generator) -> tuple[Array, Array]:
    """Control points (N_ROWS, n, 2) of the arrangement, and of the first initial guess.

    The energy is minimised (L-BFGS-B) from positions that reproduce the motions' mean distances, from a lattice, and
    from a perturbation of the first; the result of least energy that keeps the curves apart is returned. If none does,
    the lattice is returned.

    Parameters
    ----------
    task : Task
        The rectangle must have room: at least as many points on `lattice` as clips.
    rng : numpy.random.Generator
    """
    n = task.distance.shape[1]
    rectangle = task.rectangle
    first = scaled(task.scale * task.distance.mean(axis=0), task.rate.mean(axis=0), rectangle)
    lattice_layout = on_lattice(first, rectangle, task.separation)
    jitter = 0.1 * (rectangle.high - rectangle.low)
    layouts = [first, lattice_layout, first + rng.uniform(-1.0, 1.0, (n, 2)) * jitter]
    energy = Energy(task)
    bounds = list(zip(np.tile(rectangle.low, N_ROWS * n), np.tile(rectangle.high, N_ROWS * n), strict=True))
    best, least = np.tile(lattice_layout, (N_ROWS, 1, 1)), np.inf
    for layout in layouts:
        # Without noise, coincident sites would have no gradient that separates them.
        noise = 1e-4 * rng.uniform(-1.0, 1.0, (n, 2))
        start = np.clip(layout + noise, rectangle.low, rectangle.high)
        result = minimize(
            energy, np.tile(start, (N_ROWS, 1, 1)).ravel(), jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": _MAX_ITERATIONS, "maxcor": 20},
        )  # fmt: skip
        controls = np.asarray(result.x).reshape(N_ROWS, n, 2)
        if float(result.fun) < least and is_apart(task, controls):
            best, least = controls, float(result.fun)
    return best, np.tile(first, (N_ROWS, 1, 1))


def is_apart(task: Task, controls: Array) -> bool:
    """Whether sites keep the separation at every angle, and near their transitions half of the approach."""
    q, _, _ = evaluate_sites(controls)
    n = q.shape[1]
    least = np.full((N_ANGLES, n, n), task.separation)
    for first, second, near in task.windows():
        allowed = np.where(near < 1.0, 0.5 * task.approach, task.separation)
        least[:, first, second] = least[:, second, first] = np.minimum(least[:, first, second], allowed)
    distance = np.linalg.norm(q[:, :, None] - q[:, None], axis=3)
    i, j = np.triu_indices(n, 1)
    return bool((distance[:, i, j] >= least[:, i, j]).all())
