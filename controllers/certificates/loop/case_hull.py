r"""Linear inclusion of a law that has cases: the slopes between which its force lies, seen from the curve.

Each case i is affine, F_i(x) = c_i + G_i x, x = (p, v), on a region R_i. At a hand x_0 on the curve, in case i, the
force at any other hand x is

.. math:: F(x) - F(x_0) = G (x - x_0), \qquad G \in \mathrm{conv}\{G_k\}

with the slopes G_k found here. For x in R_i, G = G_i. For x in R_j the excess q = F_j − F_i decides: where q(x_0) = 0,
G = G_j; where q has one sign on R_j and the other at x_0, q(x) = s (q(x) − q(x_0)) with 0 ≤ s ≤ 1, so that G lies
between G_i and G_j. The signs are bounds of linear programs over the closure of R_j. Any other excess is a force that
no slope bounds, as one that jumps on the curve. A loop that is stable under arbitrary switching of the slopes is stable
with the law (absolute stability; Boyd et al., *Linear Matrix Inequalities in System and Control Theory*, 1994, 5.1).
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import casadi
import numpy as np
from scipy.optimize import linprog

from controllers.certificates.loop.followed_number import Condition
from controllers.certificates.loop.law_cases import Case, Cases
from controllers.errors import ControllerError
from controllers.state import Array

_NO_EXCESS = 1e-9  # [N] below any force: rounding of the sums that an excess is made of
_SAME = 1e-9  # share of the largest slope below which two slopes are the same
_ROUNDED = 1e-12  # share of the largest singular value below which one is rounding


class Affine(NamedTuple):
    """One case c + G x [N] of x = (p, v), for A x ≤ b and possibly more.

    Attributes
    ----------
    slope : Array
        G, shape (3, 6).
    offset : Array
        c, shape (3,).
    normals, bounds : Array
        A, shape (m, 6), each row of norm 1, and b, shape (m,): the conditions that are linear. Without the others the
        region is larger, so that what holds on it holds in the case.
    """

    slope: Array
    offset: Array
    normals: Array
    bounds: Array

    def most(self, slope: Array, offset: float) -> float:
        """Supremum of slope · x + offset over the region: inf if unbounded, −inf if the region is empty."""
        found = linprog(-slope, self.normals, self.bounds, bounds=(None, None), method="highs")
        if found.status == 2:
            return -np.inf
        return float(slope @ found.x) + offset if found.status == 0 else np.inf


def slopes_of(cases: Cases, references: Array) -> list[Array]:
    """Slopes G_k, each (3, 6), in whose convex hull the law's slope lies as seen from hands on the curve.

    Parameters
    ----------
    cases : Cases
        A law.
    references : Array, shape (n, 6)
        Hands x_0 = (p, v) on the curve.

    Raises
    ------
    ControllerError
        If a case is not linear in the hand's position and velocity, or an excess is bounded by no slope.
    """
    affine = [_affine(cases, case) for case in cases.cases]
    which = np.array(cases.chosen.map(len(references))(references[:, :3].T, references[:, 3:].T)[1])
    if which.min() < 0.0:
        raise ControllerError(f"{cases.law.place} has no case for some hands on the curve")
    found: list[Array] = []
    for i in np.unique(which).astype(int).tolist():
        here = affine[i]
        found.append(here.slope)
        for j, there in enumerate(affine):
            if j != i and there.most(np.zeros(6), 0.0) > -np.inf:
                found += _slopes_between(cases, here, there, references[which.ravel() == i])
    size = max(float(np.abs(slope).max()) for slope in found)
    distinct: list[Array] = []
    for slope in found:
        if all(np.abs(slope - other).max() > _SAME * size for other in distinct):
            distinct.append(slope)
    return distinct


def _affine(cases: Cases, case: Case) -> Affine:
    x = casadi.vertcat(cases.p, cases.v)
    slope = casadi.jacobian(case.force, x)
    if not slope.is_constant():
        raise ControllerError(
            f"{cases.law.place} has cases whose force is not linear in the hand's position and velocity; stability is "
            "certified of one smooth expression, or of cases that are linear"
        )
    given = Affine(_numbers(slope, x).reshape(3, 6), _numbers(case.force, x), *_region(case.conditions, x))
    if not (np.isfinite(given.slope).all() and np.isfinite(given.offset).all()):
        raise ControllerError(f"{cases.law.place} has a case whose force is no number")
    return given


def _region(conditions: Sequence[Condition], x: casadi.SX) -> tuple[Array, Array]:
    """The linear ones of some conditions as A x ≤ b."""
    rows: list[Array] = []
    for gap, kind, holds in conditions:
        normal = casadi.jacobian(gap, x)
        if not normal.is_constant():
            continue
        row = np.concatenate([_numbers(normal, x), _numbers(gap, x)])
        size = float(np.linalg.norm(row[:6]))
        if size > 0.0 and np.isfinite(row).all():
            # gap ≤ 0 where it holds and gap ≥ 0 where it does not; both where it is zero, neither where it is not.
            signs = ((1.0, -1.0) if holds else ()) if kind == "==" else (1.0 if holds else -1.0,)
            rows += [sign / size * row for sign in signs]
    table = np.array(rows).reshape(-1, 7)
    return table[:, :6], -table[:, 6]


def _numbers(expression: casadi.SX, x: casadi.SX) -> Array:
    """An expression's values at x = 0, flattened by rows."""
    return np.array(casadi.Function("at_zero", [x], [casadi.densify(expression)])(0.0)).ravel()


def _slopes_between(cases: Cases, here: Affine, there: Affine, references: Array) -> list[Array]:
    """Slopes for a hand in the case `there`, seen from references in the case `here`."""
    slope, offset = there.slope - here.slope, there.offset - here.offset
    excess = references @ slope.T + offset
    if np.abs(excess).max() <= _NO_EXCESS:
        return [there.slope]
    # An excess along one direction is a number times a direction; otherwise each axis is a direction of its own.
    table = np.column_stack([slope, offset])
    _, sizes, rows = np.linalg.svd(table)
    if sizes[1] <= _ROUNDED * sizes[0]:
        parts = [((table @ rows[0])[:, None], rows[0])]
    else:
        parts = [(np.eye(3)[:, [axis]], table[axis]) for axis in range(3)]
    choices: list[tuple[Array, ...]] = []
    for along, row in parts:
        at_curve, nothing = references @ row[:6] + row[6], _NO_EXCESS / float(np.linalg.norm(along))
        part = along * row[:6]
        if np.abs(at_curve).max() <= nothing:
            choices.append((part,))
            continue
        above = at_curve.max() <= nothing and there.most(-row[:6], -float(row[6])) <= nothing
        below = at_curve.min() >= -nothing and there.most(row[:6], float(row[6])) <= nothing
        if not (above or below):
            raise ControllerError(
                f"no stiffness and damping, as seen from the curve, bound the force of {cases.law.place} where it "
                "changes between its cases, as where it jumps; stability is certified of cases that meet without a jump"
            )
        choices.append((0.0 * part, part))
    return [here.slope + sum(chosen) for chosen in itertools.product(*choices)]
