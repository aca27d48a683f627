r"""Remainder: bounds on what the decoupled axes of `lyapunov` with frozen inertia neglect, as rates and forces.

It gives an input-to-state estimate of the whole loop. With ‖x‖ = √V ≤ ℓ, the executed loop obeys

.. math:: \|x^+\| \le \sqrt{e^{-2rT} \|x\|^2 + T \textstyle\sum_c s_c w_c^2} + T\,(r_0 \|x\| + \delta)

r is the form's rate and s_c its gains for the forces w_c; r_0 is the loss of rate due to the nonlinearity, δ the terms
that neither vanish on the curve nor are forces. All of them grow with ℓ. Every term is an upper bound in the tube, for
the form's worst mass and hand. Terms of second order in T are covered by the factor `SECOND_ORDER_FACTOR`.
"""

from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.laws import SymbolicLaw
from controllers.certificates.region.lyapunov import Axis, Cell, Form
from controllers.certificates.region.tube_bounds import TubeBounds
from controllers.curves.trajectory import Trajectory
from geometry.arrays import Array

# Factor for terms of second order in T. From 5 mm off the demo's curve a hand comes within 1.8 mm, with 1.1 too; with
# 1 it comes within 1.65 mm.
SECOND_ORDER_FACTOR = 1.05
_GRID_FACTOR = 1.01  # for extrema of the curve between the phases of its grid
_MAX_CURVED_DISTANCE = 0.7  # distance from the curve over its radius of curvature up to which the bounds are finite
N_MASSES = 120  # masses at which terms that are not convex in the mass are evaluated; half or twice certifies the same


class Course(NamedTuple):
    """Curve data: largest and smallest pace [m/s], curvature [1/m], largest |φ̈| [m/s²], largest |cos| between φ̇ and φ̈.

    For a law that does not carry the hand, largest pace and |φ̈| are zero. The last is the largest change of the flow's
    speed across the curve [1/s]: ρ|φ̇|κ for a parallel flow, else 0.
    """

    pace: float
    slowest: float
    curvature: float
    acceleration: float
    cosine: float
    shear: float

    @staticmethod
    def of(curve: Trajectory, law: SymbolicLaw, n: int = 4000) -> "Course":
        """Evaluate a curve on a grid that is fine compared with the pieces of its spline."""
        phases = np.linspace(curve.start, curve.end, n)
        velocity, acceleration = curve.velocity(phases), curve.acceleration(phases)
        speed, size = np.linalg.norm(velocity, axis=1), np.linalg.norm(acceleration, axis=1)
        cosine = np.abs(np.einsum("ni,ni->n", velocity, acceleration)) / np.maximum(speed * size, 1e-300)
        bend = size * np.sqrt(np.maximum(0.0, 1.0 - cosine**2)) / speed**2
        moving = _GRID_FACTOR * law.carries
        return Course(
            moving * float(speed.max()), float(speed.min()), _GRID_FACTOR * float(bend.max()),
            moving * float(size.max()), float(cosine.max()), _GRID_FACTOR * law.parallel * float((bend * speed).max()),
        )  # fmt: skip


class Remainder(NamedTuple):
    """Bounds on the remainder over a level set, and the extent of √V = 1.

    Attributes
    ----------
    rate, drift : float
        r_0 and δ [1/s].
    newtons, metric : float
        Forces w_c: [N], and [N/√kg] in the metric of the device's own mass.
    shift : float
        Largest shift of a state by encoder quantisation, in √V.
    distance, speed, force : float
        Largest |e| [m], |ν| [m/s] and force of the law [N] on √V = 1.
    """

    rate: float
    drift: float
    newtons: float
    metric: float
    shift: float
    distance: float
    speed: float
    force: float


class _MassTerms(NamedTuple):
    """Terms that are not convex in the mass μ: largest over a dense grid of masses and the corners of the hands.

    Attributes
    ----------
    motion : float
        |ν| on √V = 1, in the metric of the device's own part of μ [√kg m/s].
    drift : float
        Relative change of V per relative change of that part [1].
    push : float
        Acceleration by a force, in the same metric [1/√kg].
    shift : float
        Change of the sampled velocity by encoder quantisation [m/s].
    place_shift, velocity_shift : float
        √V of that change: as a velocity of e [1/s], and as a step of ν [1].
    """

    motion: float
    drift: float
    push: float
    shift: float
    place_shift: float
    velocity_shift: float


def _mass_terms(axis: Axis, form: Form, cell: Cell, rounding: float) -> _MassTerms:
    z = cell.corners(N_MASSES)
    dense = np.array([form.numbers(row) for row in z])
    back = np.linalg.inv(dense)
    lever = cell.lever(z[:, 0])
    eigen = np.linalg.eigh(form.beta)
    size = (eigen[1] * np.abs(eigen[0])) @ eigen[1].T
    roots = np.linalg.cholesky(back)
    drifts = np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ size @ roots)[:, -1] * lever**2
    blocks = np.sqrt(np.einsum("nii->ni", dense)) / axis.scale
    shift = axis.damping / z[:, 0] * rounding
    return _MassTerms(
        motion=float((lever * np.sqrt(back[:, 1, 1])).max()) * axis.scale[1], drift=float(drifts.max()),
        push=float((lever / z[:, 0]).max()), shift=float(shift.max()),
        place_shift=float((blocks[:, 0] * shift).max()), velocity_shift=float((blocks[:, 1] * shift).max()),
    )  # fmt: skip


class _Ball(NamedTuple):
    """√V ≤ 1 for the hands at the corners of a cell: forms P, their inverses, and the units `scale` of the state."""

    forms: Array
    inverses: Array
    scale: Array

    @staticmethod
    def of(axis: Axis, form: Form, cell: Cell) -> "_Ball":
        """The ball of a form; P⁻¹ is convex in z, so that what is largest over a cell is so at a corner."""
        forms = np.array([form.numbers(z) for z in cell.corners(2)])
        return _Ball(forms, np.asarray(np.linalg.inv(forms), dtype=np.float64), axis.scale)

    def largest(self, *numbers: float) -> float:
        """Largest value of a row vector, given without its last zeros."""
        row = np.array([*numbers, *np.zeros(len(self.scale) - len(numbers))]) * self.scale
        return float(np.sqrt(np.einsum("i,nij,j->n", row, self.inverses, row).max()))

    def largest_product(self, e: float, v: float) -> float:
        """Largest |e| |ν|, by ½(σ|e|² + |ν|²/σ); e and v are the largest |e| and |ν|."""
        weight = np.diag([0.5 * v / e * self.scale[0] ** 2, 0.5 * e / v * self.scale[1] ** 2])
        roots = np.linalg.cholesky(self.inverses[:, :2, :2])
        return float(np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ weight @ roots)[:, -1].max())

    def turn_level(self) -> float:
        """√V of a change of velocity and filtered velocity by 1 m/s, as where φ̇ changes its direction."""
        row = np.concatenate([[0.0], np.ones(2) / self.scale[1:3], np.zeros(len(self.scale) - 3)])
        return float(np.sqrt(np.einsum("i,nij,j->n", row, self.forms, row).max()))

    def slide_level(self, form: Form, tube: TubeBounds, e: float) -> float:
        """Largest change of √V, on √V = 1, per metre by which e moves along the curve."""
        part = self.forms[:, 0].copy()
        part[:, 0] = 0.0
        spread = abs(float(form.beta[0, 0])) * (tube.mass_high - tube.mass_low)
        cross = 0.5 * spread / self.scale[0] ** 2 * e
        cross += float(np.sqrt(np.einsum("ni,nij,nj->n", part, self.inverses, part).max())) / self.scale[0]
        return cross


def remainder(
    axis: Axis, form: Form, cell: Cell, tube: TubeBounds, course: Course, share: float, level: float
) -> Remainder:
    """Bounds of the remainder on {√V ≤ level} for one cell of hands.

    Parameters
    ----------
    axis, form, cell
        The loop's axis, its form and the hands.
    tube : TubeBounds
        Bounds of the device, in a tube that contains the level set.
    course : Course
        Data of the curve.
    share : float
        Smallest value w of the window in the tube.
    level : float
        ℓ, at most 1.
    """
    t, k, b = axis.period, axis.stiffness, axis.damping
    ball = _Ball.of(axis, form, cell)
    e, v, y = (ball.largest(*np.eye(3)[i]) for i in range(3))
    force = max(ball.largest(k, 0.0, b), ball.largest(*np.eye(axis.size)[-1]) if axis.delay else 0.0)
    spring, viscous = cell.high[2], cell.high[1]
    total = ball.largest(k + spring, viscous, b)
    pace_share, slow_share = b / (b + cell.low[1]), b / (b + viscous)
    pace = pace_share * course.pace
    overshoot = 1.0 + viscous * t / (4.0 * cell.low[0]) + spring * t * t / (8.0 * cell.low[0])
    speed = pace + overshoot * v * level
    curved_distance = course.curvature * e * level
    if curved_distance >= _MAX_CURVED_DISTANCE:
        return Remainder(np.inf, np.inf, np.inf, np.inf, np.inf, e, v, force)
    bend = course.curvature / (1.0 - curved_distance)

    masses = _mass_terms(axis, form, cell, tube.rounding)
    motion = masses.motion * overshoot * level
    delay_travel = (1 + axis.delay) * t * speed

    newtons = (
        tube.jacobian_slope * delay_travel * (force * level + b * course.pace * (1.0 - slow_share))
        + tube.weight_slope * delay_travel
        + (1.0 - share) * b * course.pace
        + b * course.shear * e * level
        + tube.coulomb
        + (b + viscous) * masses.shift + (k + tube.mass_slope * speed * b) * tube.rounding
        + axis.slides * 0.5 * t * spring * v * overshoot * level
    )  # fmt: skip
    metric = (
        tube.drag * (motion + np.sqrt(tube.mass_high) * pace)
        + tube.coriolis * speed * (motion + np.sqrt(tube.mass_high) * pace)
        + tube.mass_slope * t * speed * masses.push * total * level
    )
    slowest = float(ball.scale[2] / np.sqrt(ball.forms[:, 2, 2].max()))  # 1/√p_yy for the largest p_yy [m/s]
    rate = 0.5 * tube.mass_slope * masses.drift * speed
    rate += tube.jacobian_slope * (axis.keep * y + 0.5 * (1.0 - axis.keep) * v * overshoot) / slowest * speed
    drift = tube.jacobian_slope * speed * pace / slowest + 2.0 * masses.place_shift
    if axis.slides:
        turn, cross = ball.turn_level(), ball.slide_level(form, tube, e)
        second_bend = 0.5 * bend * bend / max(course.curvature, 1e-9)
        rate += bend * (pace * e + overshoot * ball.largest_product(e, v) * level) * cross
        rate += (bend + second_bend) * v * overshoot * t * speed * cross
        rate += 0.5 * course.acceleration * pace_share / course.slowest * (v * turn + course.cosine)
        drift += pace_share**2 * course.acceleration * turn
        drift += second_bend * t * speed * pace * cross
    return Remainder(
        rate=SECOND_ORDER_FACTOR * rate, drift=SECOND_ORDER_FACTOR * drift,
        newtons=SECOND_ORDER_FACTOR * newtons, metric=SECOND_ORDER_FACTOR * metric,
        shift=masses.velocity_shift, distance=e, speed=v, force=force,
    )  # fmt: skip
