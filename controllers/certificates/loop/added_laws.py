"""User-defined laws on CasADi symbols, added to the law that drives the hand along a curve."""

import itertools
from collections.abc import Sequence

import casadi
import numpy as np

from controllers.certificates.loop.case_hull import slopes_of
from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.law_cases import MAX_CASES, Cases
from controllers.certificates.loop.laws import SymbolicLaw
from controllers.certificates.loop.stability import N_PHASES, CertifiedRiver
from controllers.curves.trajectory import piece_point, piece_velocity
from controllers.errors import ControllerError
from geometry.arrays import Array

# Phases of the curve at which a law is linearised: 20 times as many as those of the loop, since a case may hold on only
# a short part of the curve.
N_REFERENCES = 20 * N_PHASES


def rivers_with(river: CertifiedRiver, added: Sequence[Cases]) -> list[CertifiedRiver]:
    """A river with user-defined laws: one linear loop, or several between which the laws' cases switch.

    A law of one expression is added as it is. A law with several cases is replaced by each of the slopes whose convex
    hull contains it, as seen from the curve (`case_hull`). Since laws have to be linear in their gains, the added
    forces are scaled with the stiffness, F + (k/k_r) Σ F_i: at the field's own gains this is the field itself, and the
    search for a critical gain scales all of it.

    Parameters
    ----------
    river : CertifiedRiver
        The law that drives the hand along the curve, with its gains.
    added : sequence of Cases
        User-defined laws.

    Raises
    ------
    ControllerError
        If the stiffness is zero, a force has no derivative on the curve, or no slopes bound it.
    """
    if not added:
        return [river]
    if river.k_r <= 0.0:
        raise ControllerError("a certificate of user-defined laws needs a stiffness k_r above zero beside them")
    phases = river.phases(N_REFERENCES)
    points, velocity = river.curve.point(phases), river.curve.velocity(phases)
    # At rest on the curve, and at the curve's speed: the states about which the loop is linearised.
    references = np.hstack([np.vstack([points, points]), np.vstack([0.0 * velocity, velocity])])
    smooth, switched = ([cases for cases in added if cases.smooth is it] for it in (True, False))
    for cases in smooth:
        cases.check_slopes(references)
    hulls = [slopes_of(cases, references) for cases in switched]
    if np.prod([len(hull) for hull in hulls]) > MAX_CASES:
        raise ControllerError(f"the user-defined laws have more than {MAX_CASES} cases together")
    combined = [sum(slopes, np.zeros((3, 6))) for slopes in itertools.product(*hulls)]
    return [river._replace(law=_law_with_added(river, smooth, switched, slope)) for slope in combined]


def _law_with_added(
    river: CertifiedRiver, smooth: Sequence[Cases], switched: Sequence[Cases], slope: Array
) -> SymbolicLaw:
    """The river's law, plus F_i of the smooth laws, plus F_i(x_0) + G (x − x_0) of the others for one slope G."""
    base, k_r = river.law, river.k_r

    def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k: Symbol, b_d: Symbol, width: Symbol) -> Symbol:
        p_curve, v_curve = vector(piece_point.py_func(piece, 0, u)), vector(piece_velocity.py_func(piece, 0, u))
        added = casadi.DM(slope) @ casadi.vertcat(p - p_curve, v - v_curve)
        for cases in smooth:
            added += cases.force(p, v)
        for cases in switched:
            added += cases.force(p_curve, v_curve)
        return base.force(p, v, piece, u, k, b_d, width) + k / k_r * added

    return base._replace(force=force)
