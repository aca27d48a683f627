r"""A Lyapunov function of the sampled loop about its curve, found by IPOPT and checked on cells by interval bounds.

State at a tick: x = (e, ν, y, f_1 … f_m). e = p − φ(t*); ν and y are the velocity and the filtered velocity less
λφ̇, the pace that the hand comes to; f are the forces of the last m ticks that are still on their way. With Λ(θ) the
mass of linkage and hand at the tip,

.. math:: V(x) = \sum_{ab} x_a^T (\alpha_{ab} I + \beta_{ab} \Lambda(\theta))\, x_b

In the eigenvectors of Λ the loop falls apart into single axes of a mass μ, an eigenvalue, with x⁺ = A(μ) x and
P(μ) = α + βμ. Only e's share along the curve, which the nearest point takes away, τ = φ̇·e⁺/|φ̇|, couples them. With
p_e(μ) = P(μ)ε_e, a_e the row of A that gives e⁺ less ε_e, q ≥ p_ee, and any σ > 0 and γ, taking it away costs at most

.. math:: V(x^+) - V(\tilde x^+) \le \tfrac{1}{4\sigma} \textstyle\sum_i (h(\mu_i)^T x_i)^2, \qquad
          h = (\sigma + q)\,a_e - 2A^T p_e + \gamma\,\varepsilon_e

(−ab ≤ (σa − b)²/4σ, Cauchy's inequality over the axes, and Σ φ̇_i e_i = 0, which γ makes use of). So V falls to ρ²V if

.. math:: \begin{pmatrix} \rho^2 P - A^T P A & h \\ h^T & 4\sigma \end{pmatrix} \succeq 0
          \quad\text{for every } \mu,\ \text{and } (b_h, k_h, w)

of damping and stiffness of the hand and the window's share: a matrix of four numbers' cells, whatever the curve.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from controllers.certificates.intervals import bounds
from controllers.state import Array

SERIES = 12  # terms of the exponential of a period: what is left out is below 1e-9 while b_h T/μ < 1
LENGTH = 0.01  # [m] that forms are scaled by, to be well conditioned
MASSES = 5  # at which the program asks for decrease; the cells ask for it everywhere
_HEAVY, _VISCOUS, _STIFF = 0.1, 8.0, 500.0  # [kg], [N s/m], [N/m] that the unknowns are scaled by
KICK = 8.0  # [√kg/s] what a push of 1 N adds to √V counts against size by 1/√μ of this
FILTER_WEIGHT = 10.0  # how much what the filter holds counts: it passes in a period or two
SPEED_WEIGHT = 0.25  # how much size in velocity counts against size in place
PARAMETERS = 4  # of an axis: μ, b_h, k_h, w


class Axis(NamedTuple):
    """One axis of the loop: gains k [N/m], b [N s/m], period T [s], the filter's s, and periods of delay."""

    stiffness: float
    damping: float
    period: float
    keep: float
    delay: int
    slides: bool

    @property
    def size(self) -> int:
        """Numbers of the state of an axis."""
        return 3 + self.delay

    @property
    def scale(self) -> Array:
        """Units of the state in which forms are written, shape (size,)."""
        speed = LENGTH * self.stiffness / self.damping
        return np.array([LENGTH, speed, speed] + [LENGTH * self.stiffness] * self.delay)

    def matrix(self, z: Any) -> list[list[Any]]:
        """A(μ) in units of `scale`, for z = (μ, b_h, k_h, w), symbols or numbers."""
        mass, drag, spring, share = (z[i] for i in range(PARAMETERS))
        t, n = self.period, self.size
        # Columns of e, ν and the integral of ν after a period, for a unit of e, of ν, and of a constant force.
        columns: list[list[Any]] = []
        for e0, v0, f0 in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
            e, v, term_e, term_v = e0, v0, e0, v0
            for order in range(1, SERIES + 1):
                push = f0 if order == 1 else 0.0
                term_e, term_v = term_v * t / order, (push - spring * term_e - drag * term_v) * t / (order * mass)
                e, v = e + term_e, v + term_v
            columns.append([e, v])
        felt = [-share * self.stiffness, 0.0, -share * self.damping] + [0.0] * self.delay
        applied = felt if self.delay == 0 else [0.0] * (n - 1) + [1.0]
        rows = [[(columns[j][i] if j < 2 else 0.0) + columns[2][i] * applied[j] for j in range(n)] for i in range(2)]
        filtered = [(1.0 - self.keep) / t * (rows[0][j] - (j == 0)) + self.keep * (j == 2) for j in range(n)]
        late = [felt] + [[float(j == 3 + i) for j in range(n)] for i in range(self.delay - 1)]
        scale = self.scale
        return [
            [row[j] * (scale[j] / scale[i]) for j in range(n)]
            for i, row in enumerate([*rows, filtered, *late[: self.delay]])
        ]

    def numbers(self, z: Any) -> Array:
        """`matrix` as an array."""
        return np.array(self.matrix(z), dtype=np.float64)


class Cell(NamedTuple):
    """Intervals of μ [kg], b_h [N s/m], k_h [N/m] and w in which one form has to do."""

    low: Array
    high: Array

    def corners(self, masses: int = MASSES) -> Array:
        """Some masses, with every corner of the rest, shape (n, 4)."""
        grid = np.geomspace(self.low[0], self.high[0], masses)
        ends = [np.unique([self.low[i], self.high[i]]) for i in range(1, PARAMETERS)]
        return np.stack(np.meshgrid(grid, *ends, indexing="ij"), axis=-1).reshape(-1, PARAMETERS)


class Form(NamedTuple):
    """V: α, β, what the hand adds to e's part, in units of `Axis.scale`; ρ = e^{−rate T}, σ, q, γ of its decrease."""

    alpha: Array
    beta: Array
    hand: Array
    rate: float
    sigma: float
    bound: float
    gauge: float

    def matrix(self, z: Any) -> list[list[Any]]:
        """P(μ, b_h, k_h), symbols or numbers: α + βμ, and e's part of the hand's damping and stiffness."""
        n = len(self.alpha)
        added = self.hand[0] * z[1] + self.hand[1] * z[2]
        return [
            [self.alpha[i][j] + self.beta[i][j] * z[0] + (added if i == j == 0 else 0.0) for j in range(n)]
            for i in range(n)
        ]

    def numbers(self, z: Any) -> Array:
        """`matrix` as an array."""
        return np.array(self.matrix(z), dtype=np.float64)


class Limits(NamedTuple):
    """What {V ≤ 1} has to stay within: the law's force [N], the distance from the curve [m] and the speed [m/s]."""

    force: float
    distance: float
    speed: float


def _symmetric(numbers: Any, size: int) -> list[list[Any]]:
    return [[numbers[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for j in range(size)] for i in range(size)]


def _congruent(a: Any, p: Any) -> list[list[Any]]:
    """AᵀPA of lists of lists."""
    n = len(p)
    pa = [[sum(p[i][k] * a[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
    return [[sum(a[k][i] * pa[k][j] for k in range(n)) for j in range(n)] for i in range(n)]


def decrease(axis: Axis, a: Any, p: Any, form: Form) -> list[list[Any]]:
    """The matrix of the module over T, of A and P as lists of lists; the last row is scaled to be of its size.

    An axis that does not slide has no h.
    """
    n, t = axis.size, axis.period
    after, keep = _congruent(a, p), np.exp(-2.0 * form.rate * t)
    matrix = [[(keep * p[i][j] - after[i][j]) / t for j in range(n)] for i in range(n)]
    if not axis.slides:
        return matrix
    speed = axis.stiffness / axis.damping
    along = [(a[0][j] - (j == 0)) / (t * speed) for j in range(n)]
    h = [
        np.sqrt(speed)
        * (
            (form.sigma + form.bound * t * speed) * along[j]
            - 2.0 * sum(a[i][j] * p[i][0] for i in range(n))
            + form.gauge * (j == 0)
        )
        for j in range(n)
    ]
    return [[*matrix[i], h[i]] for i in range(n)] + [[*h, 4.0 * form.sigma]]


def find_form(axis: Axis, cell: Cell, limits: Limits, rate: float) -> Form | None:
    """The form of a large level set that decreases at a rate [1/s] on the corners of a cell; None if none is found.

    What has to be positive definite is linear in the unknowns: IPOPT minimises s, then the size's inverse, with a
    barrier −Σ log det(M + s I); it begins inside, with s large.
    """
    n, scale, entries = axis.size, axis.scale, axis.size * (axis.size + 1) // 2
    x, s = ca.SX.sym("x", 2 * entries + 6), ca.SX.sym("s")

    def form_of(values: Any) -> Form:
        low, slope = (_symmetric([values[k * entries + i] for i in range(entries)], n) for k in range(2))
        rest = [values[2 * entries + i] for i in range(5)]
        slope = [[value / _HEAVY for value in row] for row in slope]
        return Form(low, slope, [rest[0] / _VISCOUS, rest[1] / _STIFF], rate, *rest[2:])  # pyright: ignore[reportArgumentType]

    form, size = form_of(x), x[2 * entries + 5]
    sigma, bound = form.sigma, form.bound
    force = np.array([axis.stiffness, 0.0, axis.damping] + [0.0] * axis.delay) * scale / limits.force
    reach = [force, np.eye(n)[0] * scale / limits.distance, np.eye(n)[1] * scale / limits.speed]
    reach += [row * scale / limits.force for row in np.eye(n)[3:]]
    logs: list[Any] = [ca.log(value + s) for value in (sigma, bound, 100.0 - size, 100.0 - bound, 100.0 - sigma)]
    for z in cell.corners():
        logs += _pivots(decrease(axis, axis.numbers(z).tolist(), form.matrix(z), form), s)
    for z in cell.corners(2):
        p = form.matrix(z)
        logs.append(ca.log(size - FILTER_WEIGHT * p[2][2] + s))
        for jolt in (np.array([0.0, 1.0, 0.0]), np.array([axis.period, 1.0, 1.0 - axis.keep])):
            kick = np.append(jolt, np.zeros(axis.delay)) / (scale * np.sqrt(z[0]) * KICK)
            logs.append(ca.log(size - sum(kick[i] * kick[j] * p[i][j] for i in range(n) for j in range(n)) + s))
        logs += [ca.log(value + s) for value in (bound - p[0][0], size - p[0][0], size - SPEED_WEIGHT * p[1][1])]
        for row in reach:
            logs += _pivots([[p[i][j] - row[i] * row[j] for j in range(n)] for i in range(n)], s)
    barrier = -ca.sum1(ca.vertcat(*logs)) / len(logs)
    options = {
        "ipopt.print_level": 0,
        "print_time": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": 200,
        "show_eval_warnings": False,
    }
    first = ca.nlpsol("first", "ipopt", {"x": ca.vertcat(x, s), "f": 10.0 * s + 0.1 * barrier}, options)
    start = np.concatenate([_first_guess(n), np.zeros(entries), [0.0, 0.0, 1.0, 2.0, 0.0, 5.0], [1e5]])
    found = np.array(first(x0=start, lbx=np.append(np.full(x.numel(), -np.inf), -0.02))["x"]).ravel()
    if found[-1] > -1e-3:
        return None
    goal = ca.substitute(size + 0.3 * barrier, s, ca.SX(0.0))
    second = ca.nlpsol("second", "ipopt", {"x": x, "f": goal}, options)
    values = np.array(second(x0=found[:-1])["x"]).ravel()
    found = form_of(values.tolist())
    return found._replace(alpha=np.array(found.alpha), beta=np.array(found.beta), hand=np.array(found.hand))


def _pivots(matrix: Any, shift: Any) -> list[Any]:
    """Logarithms of the pivots of M + s I: log det, and not finite unless it is positive definite."""
    rows = [[matrix[i][j] + (shift if i == j else 0.0) for j in range(len(matrix))] for i in range(len(matrix))]
    logs: list[Any] = []
    for k in range(len(rows)):
        logs.append(ca.log(rows[k][k]))
        for i in range(k + 1, len(rows)):
            share = rows[i][k] / rows[k][k]
            for j in range(k + 1, len(rows)):
                rows[i][j] = rows[i][j] - share * rows[k][j]
    return logs


def _first_guess(n: int) -> Array:
    rows, columns = np.tril_indices(n)
    return np.where(rows == columns, 1.0, 0.0)


class Checked(NamedTuple):
    """Cells on which the decrease was checked, and by how much a corner's matrix may differ from one inside [1/s]."""

    cells: int
    slack: float
    least: float


def check_form(axis: Axis, form: Form, cell: Cell, counts: tuple[int, int, int, int]) -> Checked:
    """Whether a form decreases everywhere in a cell: `least` is positive, the least eigenvalue on corners less `slack`.

    On each of the cells' parts a matrix differs from what is interpolated between its corners, entry by entry, by at
    most Σ h_i²/8 sup|∂²/∂z_i²|; the suprema are interval bounds of CasADi's second derivatives over the whole part.
    What is interpolated between positive definite matrices is positive definite.
    """
    z = ca.SX.sym("z", PARAMETERS)
    rows = decrease(axis, axis.matrix(z), form.matrix(z), form)
    matrix = ca.vertcat(*(ca.horzcat(*row) for row in rows))
    edges = [
        (np.geomspace if i == 0 else np.linspace)(cell.low[i], cell.high[i], counts[i] + 1)
        if cell.high[i] > cell.low[i] else np.array([cell.low[i]] * 2)
        for i in range(PARAMETERS)
    ]  # fmt: skip
    parts = np.stack(np.meshgrid(*(np.arange(len(edge) - 1) for edge in edges), indexing="ij"), axis=-1)
    parts = parts.reshape(-1, PARAMETERS)
    low, high = (np.stack([edges[i][parts[:, i] + k] for i in range(PARAMETERS)], axis=1) for k in (0, 1))
    curvature = np.zeros((len(low), len(rows), len(rows)))
    for i in range(PARAMETERS):
        if cell.high[i] > cell.low[i]:
            second = ca.jacobian(ca.jacobian(ca.vec(matrix), z[i]), z[i])
            ends = bounds(ca.Function("second", [z], [ca.reshape(second, *matrix.shape)]), low, high)
            curvature += np.maximum(np.abs(ends[0]), np.abs(ends[1])) * (high - low)[:, i, None, None] ** 2 / 8.0
    slack = np.linalg.norm(curvature, axis=(1, 2))
    evaluate = ca.Function("matrix", [z], [matrix])
    least = np.full(len(low), np.inf)
    for choice in np.ndindex(*(2,) * PARAMETERS):
        corner = np.where(np.array(choice), high, low)
        blocks = np.array(evaluate.map(len(corner))(corner.T)).reshape(len(rows), len(corner), len(rows))
        blocks = blocks.transpose(1, 0, 2)
        least = np.minimum(least, np.linalg.eigvalsh(0.5 * (blocks + blocks.transpose(0, 2, 1)))[:, 0])
    return Checked(len(low), float(slack.max()), float((least - slack).min()))
