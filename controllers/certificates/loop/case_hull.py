r"""Linear inclusion of a law with several cases: slopes whose convex hull contains the law, seen from the curve.

Each case i is affine, F_i(x) = c_i + G_i x, x = (p, v), on a region R_i. At a hand x_0 on the curve, in case i, the
force at any other hand x is

.. math:: F(x) - F(x_0) = G (x - x_0), \qquad G \in \mathrm{conv}\{G_k\}

with the slopes G_k found here. For x in R_i, G = G_i. For x in R_j the excess q = F_j − F_i decides: where q(x_0) = 0,
G = G_j; where q has one sign on R_j and the other at x_0, q(x) = s (q(x) − q(x_0)) with 0 ≤ s ≤ 1, so that G lies
between G_i and G_j. The signs follow from linear programs over the closure of R_j. No slope bounds any other excess,
such as that of a force that jumps on the curve. A loop that is stable under arbitrary switching of the slopes is also
stable with the law (absolute stability; Boyd et al., *Linear Matrix Inequalities in System and Control Theory*, 1994,
5.1).
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import casadi
import numpy as np
from scipy.optimize import linprog

from controllers.certificates.loop.law_cases import Case, Cases
from controllers.certificates.loop.symbolic_execution import Condition
from controllers.errors import ControllerError
from geometry.arrays import Array

_EXCESS_TOLERANCE = 1e-9  # [N] smaller than any force: the rounding error of an excess
_SLOPE_TOLERANCE = 1e-9  # fraction of the largest slope below which two slopes count as equal
_RANK_TOLERANCE = 1e-12  # fraction of the largest singular value below which a singular value counts as zero


class Affine(NamedTuple):
    """One case c + G x [N] of x = (p, v), for A x ≤ b and possibly more.

    Attributes
    ----------
    slope : Array
        G, shape (3, 6).
    offset : Array
        c, shape (3,).
    normals, bounds : Array
        A, shape (m, 6), each row of norm 1, and b, shape (m,): the conditions that are linear. Without the others, the
        region is larger, so what holds on it also holds in the case.
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
    """Slopes G_k, each (3, 6), whose convex hull contains the law's slope as seen from hands on the curve.

    Parameters
    ----------
    cases : Cases
        A law.
    references : Array, shape (n, 6)
        Hands x_0 = (p, v) on the curve.

    Raises
    ------
    ControllerError
        If a case is not linear in the hand's position and velocity, or no slope bounds an excess.
    """
    affine = [_affine_case(cases, case) for case in cases.cases]
    case_index = np.array(cases.chosen.map(len(references))(references[:, :3].T, references[:, 3:].T)[1])
    if case_index.min() < 0.0:
        raise ControllerError(f"{cases.law.place} has no case for some hands on the curve")
    slopes: list[Array] = []
    for i in np.unique(case_index).astype(int).tolist():
        here = affine[i]
        slopes.append(here.slope)
        for j, there in enumerate(affine):
            if j != i and there.most(np.zeros(6), 0.0) > -np.inf:
                slopes += _slopes_between(cases, here, there, references[case_index.ravel() == i])
    size = max(float(np.abs(slope).max()) for slope in slopes)
    distinct: list[Array] = []
    for slope in slopes:
        if all(np.abs(slope - other).max() > _SLOPE_TOLERANCE * size for other in distinct):
            distinct.append(slope)
    return distinct


def _affine_case(cases: Cases, case: Case) -> Affine:
    x = casadi.vertcat(cases.p, cases.v)
    slope = casadi.jacobian(case.force, x)
    if not slope.is_constant():
        raise ControllerError(
            f"{cases.law.place} has cases whose force is not linear in the hand's position and velocity; stability is "
            "certified of one smooth expression, or of cases that are linear"
        )
    result = Affine(_at_zero(slope, x).reshape(3, 6), _at_zero(case.force, x), *_linear_region(case.conditions, x))
    if not (np.isfinite(result.slope).all() and np.isfinite(result.offset).all()):
        raise ControllerError(f"{cases.law.place} has a case whose force is no number")
    return result


def _linear_region(conditions: Sequence[Condition], x: casadi.SX) -> tuple[Array, Array]:
    """The linear conditions among several, as A x ≤ b."""
    rows: list[Array] = []
    for gap, kind, holds in conditions:
        normal = casadi.jacobian(gap, x)
        if not normal.is_constant():
            continue
        row = np.concatenate([_at_zero(normal, x), _at_zero(gap, x)])
        size = float(np.linalg.norm(row[:6]))
        if size > 0.0 and np.isfinite(row).all():
            # A comparison that holds gives gap ≤ 0, one that fails gap ≥ 0. Equality gives both, inequality neither.
            signs = ((1.0, -1.0) if holds else ()) if kind == "==" else (1.0 if holds else -1.0,)
            rows += [sign / size * row for sign in signs]
    table = np.array(rows).reshape(-1, 7)
    return table[:, :6], -table[:, 6]


def _at_zero(expression: casadi.SX, x: casadi.SX) -> Array:
    """An expression's values at x = 0, flattened by rows."""
    return np.array(casadi.Function("at_zero", [x], [casadi.densify(expression)])(0.0)).ravel()


def _slopes_between(cases: Cases, here: Affine, there: Affine, references: Array) -> list[Array]:
    """Slopes for a hand in the case `there`, seen from references in the case `here`."""
    slope, offset = there.slope - here.slope, there.offset - here.offset
    excess = references @ slope.T + offset
    if np.abs(excess).max() <= _EXCESS_TOLERANCE:
        return [there.slope]
    # If the excess has one fixed direction, it is a number times that direction; otherwise take each axis separately.
    table = np.column_stack([slope, offset])
    _, sizes, rows = np.linalg.svd(table)
    if sizes[1] <= _RANK_TOLERANCE * sizes[0]:
        parts = [((table @ rows[0])[:, None], rows[0])]
    else:
        parts = [(np.eye(3)[:, [axis]], table[axis]) for axis in range(3)]
    choices: list[tuple[Array, ...]] = []
    for direction, row in parts:
        curve_excess, tolerance = references @ row[:6] + row[6], _EXCESS_TOLERANCE / float(np.linalg.norm(direction))
        part = direction * row[:6]
        if np.abs(curve_excess).max() <= tolerance:
            choices.append((part,))
            continue
        above = curve_excess.max() <= tolerance and there.most(-row[:6], -float(row[6])) <= tolerance
        below = curve_excess.min() >= -tolerance and there.most(row[:6], float(row[6])) <= tolerance
        if not (above or below):
            raise ControllerError(
                f"no stiffness and damping, as seen from the curve, bound the force of {cases.law.place} where it "
                "changes between its cases, as where it jumps; stability is certified of cases that meet without a jump"
            )
        choices.append((0.0 * part, part))
    return [here.slope + sum(chosen) for chosen in itertools.product(*choices)]
