r"""What the frozen axes of `lyapunov` leave out, as rates and forces: an input-to-state estimate of the whole loop.

With ‖x‖ = √V ≤ ℓ, the loop that runs obeys

.. math:: \|x^+\| \le \bigl(1 - T\,(r - r_0 - r_1 \ell)\bigr)\,\|x\| + T\,\delta

r is the form's rate; r_0 and r_1 ℓ are what the nonlinearity takes of it, δ what does not vanish on the curve.
Every term is the largest it can be in the tube, with the form's worst mass and hand. Terms of second order in T are
made good by `SAFE`.
"""

from typing import NamedTuple

import numpy as np

from controllers.certificates.lyapunov import Axis, Cell, Form
from controllers.certificates.tube_bounds import TubeBounds
from controllers.curves.trajectory import Trajectory
from controllers.state import Array

SAFE = 1.05
DENSE = 120  # masses at which what is not convex in the mass is evaluated


class Course(NamedTuple):
    """The curve as the loop knows it: pace [m/s], curvature [1/m], largest |φ̈| [m/s²], largest |cos| between φ̇ and φ̈.

    A law that does not carry the hand has no pace.
    """

    pace: float
    slowest: float
    curvature: float
    acceleration: float
    cosine: float

    @staticmethod
    def of(curve: Trajectory, carries: bool, n: int = 4000) -> "Course":
        """On a grid so fine that a spline does not hide anything between its points."""
        phases = np.linspace(curve.start, curve.end, n)
        velocity, acceleration = curve.velocity(phases), curve.acceleration(phases)
        speed, size = np.linalg.norm(velocity, axis=1), np.linalg.norm(acceleration, axis=1)
        cosine = np.abs(np.einsum("ni,ni->n", velocity, acceleration)) / np.maximum(speed * size, 1e-300)
        bend = size * np.sqrt(np.maximum(0.0, 1.0 - cosine**2)) / speed**2
        moving = 1.01 * carries
        return Course(
            moving * float(speed.max()), float(speed.min()), 1.01 * float(bend.max()), moving * float(size.max()),
            float(cosine.max()),
        )  # fmt: skip


class Remainder(NamedTuple):
    """Bounds on a level set, and what √V = 1 is worth.

    Attributes
    ----------
    rate, rate_by_level, drift : float
        r_0, r_1 and δ [1/s].
    push : float
        What a push of 1 N adds to δ [1/s].
    shift : float
        How far the encoders' rounding shifts a state, in √V.
    distance, speed, force : float
        Largest |e| [m], |ν| [m/s] and force of the law [N] on √V = 1.
    """

    rate: float
    rate_by_level: float
    drift: float
    push: float
    shift: float
    distance: float
    speed: float
    force: float


def remainder(
    axis: Axis, form: Form, cell: Cell, tube: TubeBounds, course: Course, share: float, level: float
) -> Remainder:
    """Bounds of the remainder on {√V ≤ level} for one cell of hands.

    Parameters
    ----------
    axis, form, cell
        The loop, its form and the hands.
    tube : TubeBounds
        Of the device, in a tube that holds the level set.
    course : Course
        Of the curve.
    share : float
        Least w of the window in the tube.
    level : float
        ℓ, at most 1.
    """
    t, n, k, b, scale = axis.period, axis.size, axis.stiffness, axis.damping, axis.scale
    unit = np.eye(n) / scale
    corners = cell.corners(2)
    forms = np.array([form.numbers(z) for z in corners])
    inverses: Array = np.asarray(np.linalg.inv(forms), dtype=np.float64)

    def reach(row: Array) -> float:
        """Largest value of a row on ‖x‖ ≤ 1; P⁻¹ is convex in z, so a corner has it."""
        return float(np.sqrt(np.einsum("i,nij,j->n", row, inverses, row).max()))

    def rows(*numbers: float) -> Array:
        return np.array([*numbers, *np.zeros(n - len(numbers))]) * scale

    e, v, y = (reach(rows(*np.eye(3)[i])) for i in range(3))
    force = max(reach(rows(k, 0.0, b)), reach(np.eye(n)[-1] * scale) if axis.delay else 0.0)
    spring, viscous = cell.high[2], cell.high[1]
    total = reach(rows(k + spring, viscous, b))
    pace_share = b / (b + cell.low[1])
    slow_share = b / (b + viscous)
    pace = pace_share * course.pace
    swing = 1.0 + viscous * t / (4.0 * cell.low[0]) + spring * t * t / (8.0 * cell.low[0])
    speed = pace + swing * v * level
    near = course.curvature * e * level
    if near >= 0.7:
        return Remainder(np.inf, np.inf, np.inf, np.inf, np.inf, e, v, force)
    bend = course.curvature / (1.0 - near)

    # What is not convex in μ, on a dense grid of masses with the corners of the rest.
    z = cell.corners(DENSE)
    dense = np.array([form.numbers(row) for row in z])
    back = np.linalg.inv(dense)
    own = np.minimum(tube.mass_high, z[:, 0] - max(0.0, cell.low[0] - tube.mass_low))
    jolts = np.array([[0.0, 1.0, 0.0], [t, 1.0, 1.0 - axis.keep]]) @ unit[:3]
    kicks = np.sqrt(np.einsum("ki,nij,kj->nk", jolts, dense, jolts).max(axis=1)) / z[:, 0]
    push = SAFE * float(kicks.max())
    metric = SAFE * float((kicks * np.sqrt(own)).max())
    motion = float(np.sqrt(own * back[:, 1, 1]).max()) * scale[1]
    swap = np.abs(np.linalg.eigvalsh(form.beta)), np.linalg.eigh(form.beta)[1]
    size = (swap[1] * swap[0]) @ swap[1].T
    roots = np.linalg.cholesky(back)
    drifts = np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ size @ roots)[:, -1] * own
    tangent = 0.5 * t * z[:, 2] * kicks * np.sqrt(back[:, 1, 1]) * scale[1] * axis.slides

    rate = tube.drag * motion * swing * metric + float(tangent.max()) * swing
    by_speed = (
        0.5 * tube.mass_slope * float(drifts.max())
        + tube.jacobian_slope * t * (1 + axis.delay) * force * push
        + tube.mass_slope * t * float((np.sqrt(own) / z[:, 0]).max()) * total * metric
        + tube.coriolis * motion * swing * metric
        + tube.jacobian_slope * (axis.keep * y + 0.5 * (1.0 - axis.keep) * v * swing) / _least(forms, 2, scale)
    )
    drift = (
        tube.coriolis * speed * np.sqrt(tube.mass_high) * pace * metric
        + tube.drag * np.sqrt(tube.mass_high) * pace * metric
        + tube.weight_slope * t * (1 + axis.delay) * speed * push
        + tube.jacobian_slope * t * (1 + axis.delay) * speed * b * course.pace * (1.0 - slow_share) * push
        + tube.jacobian_slope * speed * pace / _least(forms, 2, scale)
        + (1.0 - share) * b * course.pace * push
        + min(tube.coulomb * push, tube.coulomb_metric * metric)
    )
    if axis.slides:
        row = np.concatenate([[0.0], np.ones(2) / scale[1:3], np.zeros(n - 3)])
        turn = float(np.sqrt(np.einsum("i,nij,j->n", row, forms, row).max()))
        part = forms[:, 0].copy()
        part[:, 0] = 0.0
        spread = abs(float(form.beta[0, 0])) * (tube.mass_high - tube.mass_low)
        cross = 0.5 * spread / scale[0] ** 2 * e
        cross += float(np.sqrt(np.einsum("ni,nij,nj->n", part, inverses, part).max())) / scale[0]
        pair = _pair(inverses, scale, e, v)
        by_pair = bend * swing * pair * cross
        rate += bend * pace * e * cross + bend * t * speed * v * swing * cross
        rate += 0.5 * course.acceleration * pace_share / course.slowest * (v * turn + course.cosine) * SAFE
        by_speed += 0.5 * bend * bend / max(course.curvature, 1e-9) * t * v * swing * cross
        drift += pace_share**2 * course.acceleration * turn
        drift += 0.5 * bend * bend / max(course.curvature, 1e-9) * t * speed * pace * cross
    else:
        by_pair = 0.0
    shift = b / z[:, 0] * tube.rounding
    blocks = np.sqrt(np.einsum("nii->ni", dense)) / scale
    noise = 2.0 * blocks[:, 0] * shift + blocks[:, 1] * (z[:, 1] / z[:, 0] + tube.mass_slope * speed) * shift
    noise += kicks * (b * shift + k * tube.rounding)
    rate += by_speed * pace
    return Remainder(
        rate=SAFE * rate, rate_by_level=SAFE * (by_speed * swing * v + by_pair),
        drift=SAFE * (drift + float(noise.max())), push=push, shift=float((blocks[:, 1] * shift).max()),
        distance=e, speed=v, force=force,
    )  # fmt: skip


def _least(forms: Array, i: int, scale: Array) -> float:
    """1/√p_ii at its largest, in SI."""
    return float(scale[i] / np.sqrt(forms[:, i, i].max()))


def _pair(inverses: Array, scale: Array, e: float, v: float) -> float:
    """Largest |e| |ν| on ‖x‖ ≤ 1, by ½(σ|e|² + |ν|²/σ)."""
    weight = np.diag([0.5 * v / e * scale[0] ** 2, 0.5 * e / v * scale[1] ** 2])
    roots = np.linalg.cholesky(inverses[:, :2, :2])
    return float(np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ weight @ roots)[:, -1].max())
