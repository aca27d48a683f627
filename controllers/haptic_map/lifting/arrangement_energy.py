r"""Energy of curves round the z axis with sites (r_i(θ), z_i(θ)), by the control points of their splines.

.. math:: E = \sum_{i<j} \Bigl\langle w\, \frac{(D_{ij} - T_{ij})^2}{\bar T^2}
          + \Bigl(1 - \frac{D_{ij}}{S_{ij}}\Bigr)_+^2 + v\, |q_i' - q_j'|^2 \Bigr\rangle
          + \sum_i \langle (1 + \dot\theta_i^4/\omega^4)\, |q_i''|^2
          + (\gamma_i |q_i'|)^2 + limits \rangle,
          \qquad \gamma_i = \frac{u}{\dot\theta_i \bar r^2}

D is the distance of two sites at an angle, T = κ d the distance of the two poses there scaled to the size of the
rectangle (multidimensional scaling, at every angle and smooth in it): a millimetre of hand motion then changes the
figure equally everywhere, so h_* is well conditioned. At a transition T falls to the approach, and v makes the curves
parallel; elsewhere S keeps them apart. The bending term grows with θ̇: where the radius changes, springs and filters
track the tangential acceleration 2 θ̇² r' with an error, which shifts the hand's angle and with it the clip's phase. A
push across a curve has a part along it where the curve slants: it changes the pace of the clip by γ |q'|, relative,
with u the speed that it adds along itself and r̄ the radius in the middle of the rectangle. `limits` penalises
excessive speed and acceleration. Sites are periodic cubic B-splines whose control points lie in the rectangle, hence so
do the sites.

Every term is a sum of squares or convex, so each has a positive semidefinite curvature: that of a pair's stress is

.. math:: 2 c \Bigl[u u^T + \bigl(1 - T/D\bigr)_+ (I - u u^T)\Bigr]

along and across the line u between two sites, that of Gauss and Newton where the sites are nearer than wanted.
"""

from dataclasses import dataclass

import numpy as np

from controllers.haptic_map.lifting.bounded_descent import Expansion
from controllers.haptic_map.lifting.room import Rectangle
from controllers.haptic_map.lifting.transitions import Transition
from geometry.arrays import Array
from geometry.easing import cubic_steps

N_ROWS = 64  # control points round the lap
_SAMPLES_PER_ROW = 3
N_ANGLES = N_ROWS * _SAMPLES_PER_ROW  # angles at which the energy is evaluated
# Sensitivities of the constants in this file are for walk, run, jump and backflip, with curves that slant and two
# strides of the walk to three of the run: they pass within 7.7 mm of each other, jump and backflip within 4.4 mm, and
# h_* changes by at most 74 % of itself per millimetre at nine of ten places (now 8.5, 6.1 mm and 67 %). Those in other
# files of this folder were found in a room with r from 20 mm on, before arrangements converged.

# [rad] distance from a transition within which two curves may be nearer than the separation. With half of it the
# distances are 9.7 and 8.4 mm, with twice 6.2 and 2.6.
TRANSITION_WINDOW = 0.9
# Target distance of the most different motions, as a fraction of the rectangle's diagonal. With 0.6 the distances are
# 6.0 and 4.0 mm and h_* changes by 77 %, with 1.0 9.5 and 4.9 mm and 62 %.
_FILL_FRACTION = 0.8
# Least distance at a transition, as a fraction of the target distance κ d of the poses. With half of it walk and run
# pass within 5.9 mm and h_* changes by 74 %, with twice 12.7 mm and 63 %.
_MIN_DISTANCE_RATIO = 0.2
# [m] largest κ d of two motions at their transition, beyond which T of the pair is reduced. Curves then pass within
# 12 mm, so a hand comes into the other's tube of 15 mm before it leaves its own. Two captured gaits alone, spread over
# the rectangle, pass 16 to 25 mm apart.
_MAX_SPAN = 0.032
# Weights of the terms. Half or twice the separation and limit weights leave the distances unchanged, the tangent weight
# changes them by 0.3 mm, the bend weight by 0.4, the approach weight by 0.6. The median condition number of h_* half
# way between two curves, 26.8, changes by 0.7, with the bend weight by 3.9.
_SEPARATION_WEIGHT, _APPROACH_WEIGHT, _TANGENT_WEIGHT, _BEND_WEIGHT, _LIMIT_WEIGHT = 40.0, 250.0, 0.7, 0.015, 40.0
PUSH_SPEED = 2.5 / 8.0
"""Speed that a push of 2.5 N adds against a damping of 8 N s/m [m/s]."""
# [rad/s] ω: a captured walk with a residual of 1.7 % of weight has 4.7 % on its curve, with ω = 3 rad/s 11 %
_BEND_RATE = 2.0
_LENGTH_UNIT = 0.02  # [m] unit of length of slopes and bends in the energy
# Safety factor on the separation and the limits, for angles between the samples. Curves come within 4.4 mm of each
# other, with 1.0 within 4.0 and with 1.2 within 4.8.
_SAFETY_FACTOR = 1.1


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
        distance = self.distance.copy()
        for at in self.transitions:
            span = self.scale * distance[round(at.angle / (2.0 * np.pi) * N_ANGLES) % N_ANGLES, at.first, at.second]
            for i, j in ((at.first, at.second), (at.second, at.first)):
                distance[:, i, j] *= min(1.0, _MAX_SPAN / max(float(span), 1e-9))
        wanted = np.maximum(self.scale * distance, _SAFETY_FACTOR * self.separation)
        least = np.full(wanted.shape, _SAFETY_FACTOR * self.separation)
        weight = np.ones(wanted.shape)
        for first, second, near in self.windows():
            nearest = np.maximum(self.approach, _MIN_DISTANCE_RATIO * self.scale * distance[:, first, second])
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

    def hand_maps(self) -> Array:
        """Linear maps from q, q', q'' to the hand's velocity and acceleration along r, θ and z.

        Shape (2, 3, 3, 2, N_ANGLES, n): which of the two, its component, order of the derivative, r or z.
        """
        w, a = self.rate, self.change
        maps = np.zeros((2, 3, 3, 2, *w.shape))
        velocity, acceleration = maps
        velocity[0, 1, 0], velocity[1, 0, 0], velocity[2, 1, 1] = w, w, w
        acceleration[0, 0, 0], acceleration[0, 1, 0], acceleration[0, 2, 0] = -w * w, a, w * w
        acceleration[1, 0, 0], acceleration[1, 1, 0] = a, 2.0 * w * w
        acceleration[2, 1, 1], acceleration[2, 2, 1] = a, w * w
        return maps

    def hand_motion(self, sites: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of the hand along r, θ and z, each (3, N_ANGLES, n); see `evaluate_sites`."""
        velocity, acceleration = np.einsum("mcoxkn,oknx->mckn", self.hand_maps(), sites)
        return velocity, acceleration


def _spline_stencil() -> Array:
    """Weights of four control points in a site of a row and its first two derivatives by θ, shape (samples, 3, 4)."""
    u, rate = (np.arange(_SAMPLES_PER_ROW) / _SAMPLES_PER_ROW)[:, None], N_ROWS / (2.0 * np.pi)
    value = [(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]
    slope = [-3 * (1 - u) ** 2, 9 * u**2 - 12 * u, -9 * u**2 + 6 * u + 3, 3 * u**2]
    bend = [6 * (1 - u), 18 * u - 12, -18 * u + 6, 6 * u]
    orders = [np.hstack(weights) * unit / 6.0 for weights, unit in ((value, 1.0), (slope, rate), (bend, rate**2))]
    return np.stack(orders, axis=1)


_STENCIL = _spline_stencil()
_ROWS = np.arange(N_ROWS)
_NEIGHBOURS = [(_ROWS + offset) % N_ROWS for offset in range(-1, 3)]
"""Rows of the control points that determine the sites of each row."""
_SLOPE_UNIT = N_ANGLES * _LENGTH_UNIT**2


def sites_of(controls: Array) -> Array:
    """Sites at `N_ROWS` equal steps of θ, shape (N_ROWS, n, 2), from control points of the same shape."""
    return evaluate_sites(controls)[0, ::_SAMPLES_PER_ROW]


def evaluate_sites(controls: Array) -> Array:
    """Sites at the samples of the lap and their first and second derivatives by θ, shape (3, N_ANGLES, n, 2)."""
    around = np.stack([controls[rows] for rows in _NEIGHBOURS])
    return np.einsum("sop,pknx->oksnx", _STENCIL, around).reshape(3, N_ANGLES, *controls.shape[1:])


class Energy:
    """E with gradient and curvature by the control points."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._target, self._min_distance, self._weight = task.targets()
        self._hand_maps = task.hand_maps()
        n = task.distance.shape[1]
        self._pairs = i, j = np.triu_indices(n, 1)
        self._incidence = np.equal.outer(np.arange(n), i).astype(float) - np.equal.outer(np.arange(n), j)
        square = self._target[:, i, j] ** 2
        self._mean_square = float(square.mean()) if n > 1 else 1.0
        # Of first and second derivatives, whose terms are quadratic.
        self._parallel = np.zeros((N_ANGLES, len(i)))
        for first, second, near in task.windows():
            pair = np.flatnonzero((i == min(first, second)) & (j == max(first, second)))
            self._parallel[:, pair] += (_TANGENT_WEIGHT * np.maximum(1.0 - 3.0 * near, 0.0) / _SLOPE_UNIT)[:, None]
        middle = 0.5 * (task.rectangle.r_min + task.rectangle.r_max)
        pace_change = PUSH_SPEED / (task.rate * middle**2)  # γ
        self._slope_stiffness = pace_change**2 / N_ANGLES
        self._bend_stiffness = _BEND_WEIGHT / _SLOPE_UNIT * (1.0 + (task.rate / _BEND_RATE) ** 4)

    def __call__(self, flat: Array) -> Expansion:
        """E at control points (N_ROWS · n · 2,), its gradient and curvature."""
        sites = evaluate_sites(flat.reshape(N_ROWS, -1, 2))
        n = sites.shape[2]
        # By q, q' and q'' at each angle.
        gradient, curvature = np.zeros_like(sites), np.zeros((3, 3, N_ANGLES, n, 2, n, 2))
        apart, gradient[0], curvature[0, 0] = self._distance_terms(sites[0])
        slant, gradient[1], curvature[1, 1] = self._parallel_term(sites[1])
        of_each, of_curves = np.zeros((3, 3, N_ANGLES, n, 2, 2)), 0.0
        for order, stiffness in ((1, self._slope_stiffness), (2, self._bend_stiffness)):
            of_curves += float((stiffness[..., None] * sites[order] ** 2).sum())
            gradient[order] += 2.0 * stiffness[..., None] * sites[order]
            of_each[order, order] = 2.0 * stiffness[..., None, None] * np.eye(2)
        for maps, limit in zip(self._hand_maps, (self._task.speed, self._task.acceleration), strict=True):
            v = np.einsum("coxkn,oknx->ckn", maps, sites)
            over, slope, bent = _limit_penalty(v, limit / _SAFETY_FACTOR)
            of_curves += over
            gradient += np.einsum("coxkn,ckn->oknx", maps, slope)
            of_each += np.einsum("coxkn,cdkn,dpykn->opknxy", maps, bent, maps, optimize=True)
        for i in range(n):
            curvature[:, :, :, i, :, i] += of_each[:, :, :, i]
        return Expansion(apart + slant + of_curves, _by_controls(gradient), _curvature_by_controls(curvature))

    def _distance_terms(self, q: Array) -> tuple[float, Array, Array]:
        """Stress and separation terms, their gradient by the sites (N_ANGLES, n, 2), and their curvature."""
        i, j = self._pairs
        step = q[:, i] - q[:, j]
        distance = np.sqrt((step**2).sum(axis=2) + 1e-12)
        target, min_distance = self._target[:, i, j], self._min_distance[:, i, j]
        weight = self._weight[:, i, j] / (self._mean_square * q.shape[1] * N_ANGLES)
        separation = _SEPARATION_WEIGHT / N_ANGLES
        error, short = distance - target, np.maximum(1.0 - distance / min_distance, 0.0)
        slope = 2.0 * (weight * error - separation * short / min_distance)
        along = 2.0 * (weight + separation * (short > 0.0) / min_distance**2)
        across = 2.0 * weight * np.maximum(error / distance, 0.0)
        u = step / distance[..., None]
        bent = (along - across)[..., None, None] * u[..., :, None] * u[..., None, :]
        bent += across[..., None, None] * np.eye(2)
        value = float((weight * error**2).sum() + separation * (short**2).sum())
        return value, self._incidence @ (slope[..., None] * u), self._between(bent)

    def _parallel_term(self, dq: Array) -> tuple[float, Array, Array]:
        """Penalty of curves that are not parallel where they meet, its gradient by the slopes, and its curvature."""
        i, j = self._pairs
        step, stiffness = dq[:, i] - dq[:, j], self._parallel[..., None]
        bent = 2.0 * stiffness[..., None] * np.eye(2)
        return float((stiffness * step**2).sum()), self._incidence @ (2.0 * stiffness * step), self._between(bent)

    def _between(self, bent: Array) -> Array:
        """Curvature (N_ANGLES, n, 2, n, 2) of terms of pairs' differences, by which it is (N_ANGLES, pairs, 2, 2)."""
        i, j = self._pairs
        n = len(self._incidence)
        blocks = np.zeros((N_ANGLES, n, n, 2, 2))
        blocks[:, i, j] = blocks[:, j, i] = -bent
        blocks[:, range(n), range(n)] = -blocks.sum(axis=2)
        return blocks.transpose(0, 1, 3, 2, 4)


def _limit_penalty(v: Array, limit: float) -> tuple[float, Array, Array]:
    """Penalty of vectors (3, N_ANGLES, n) longer than allowed, its gradient, and its curvature (3, 3, N_ANGLES, n)."""
    size = np.sqrt((v**2).sum(axis=0) + 1e-24)
    over, weight, u = np.maximum(size / limit - 1.0, 0.0), _LIMIT_WEIGHT / N_ANGLES, v / size
    along = 2.0 * weight * (over > 0.0) / limit**2
    across = 2.0 * weight * over / (limit * size)
    bent = (along - across) * u[:, None] * u + across * np.eye(3)[..., None, None]
    return weight * float((over**2).sum()), 2.0 * weight * over / limit * u, bent


def _by_controls(gradient: Array) -> Array:
    """Gradient by the control points (N_ROWS · n · 2,) from that by `evaluate_sites`."""
    shape = (3, N_ROWS, _SAMPLES_PER_ROW, *gradient.shape[2:])
    parts = np.einsum("sop,oksnx->pknx", _STENCIL, gradient.reshape(shape))
    total = np.zeros_like(parts[0])
    for part, rows in zip(parts, _NEIGHBOURS, strict=True):
        total[rows] += part
    return total.ravel()


def _curvature_by_controls(curvature: Array) -> Array:
    """Curvature by the control points from that by sites and derivatives, (3, 3, N_ANGLES, n, 2, n, 2)."""
    m = 2 * curvature.shape[3]
    local = curvature.reshape(3, 3, N_ROWS, _SAMPLES_PER_ROW, m, m)
    parts = np.einsum("sop,otksab,stq->pqkab", _STENCIL, local, _STENCIL, optimize=True)
    total = np.zeros((N_ROWS, N_ROWS, m, m))
    for part, rows in zip(parts, _NEIGHBOURS, strict=True):
        for block, columns in zip(part, _NEIGHBOURS, strict=True):
            total[rows, columns] += block
    return total.transpose(0, 2, 1, 3).reshape(N_ROWS * m, N_ROWS * m)
