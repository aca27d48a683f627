"""User-defined laws on CasADi symbols, added to the law that drives along a curve."""

import itertools
from collections.abc import Sequence

import casadi
import numpy as np

from controllers.certificates.loop.case_hull import slopes_of
from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.law_cases import MOST_CASES, Cases
from controllers.certificates.loop.laws import Law
from controllers.certificates.loop.stability import PHASES, River
from controllers.curves.trajectory import piece_point, piece_velocity
from controllers.errors import ControllerError
from controllers.state import Array

# Hands on the curve from which a law is seen, a phase each: 20 times as many as those of the loop, since a case may
# hold on a short part of the curve.
REFERENCES = 20 * PHASES


def rivers_with(river: River, added: Sequence[Cases]) -> list[River]:
    """A river with user-defined laws: one linear loop, or several between which the laws' cases switch.

    A law of one expression is added as it is. A law that has cases is replaced by each of the slopes between which it
    lies as seen from the curve (`case_hull`). Laws have to be linear in their gains, so that the added forces are
    scaled with the stiffness, F + (k/k_r) Σ F_i: at the field's own gains this is the field itself, and the search for
    a critical gain scales all of it.

    Parameters
    ----------
    river : River
        The law that drives along the curve, with its gains.
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
        raise ControllerError("a certificate of laws of one's own needs a stiffness k_r above zero beside them")
    phases = river.phases(REFERENCES)
    points, velocity = river.curve.point(phases), river.curve.velocity(phases)
    # At rest on the curve, and at its own pace: the states about which the loop is linearised.
    references = np.hstack([np.vstack([points, points]), np.vstack([0.0 * velocity, velocity])])
    smooth, switched = ([cases for cases in added if cases.smooth is it] for it in (True, False))
    for cases in smooth:
        cases.check_slopes(references)
    hulls = [slopes_of(cases, references) for cases in switched]
    if np.prod([len(hull) for hull in hulls]) > MOST_CASES:
        raise ControllerError(f"the laws of one's own have more than {MOST_CASES} cases together")
    together = [sum(slopes, np.zeros((3, 6))) for slopes in itertools.product(*hulls)]
    return [river._replace(law=_with(river, smooth, switched, slope)) for slope in together]


def _with(river: River, smooth: Sequence[Cases], switched: Sequence[Cases], slope: Array) -> Law:
    """The river's law, plus F_i of the smooth laws, plus F_i(x_0) + G (x − x_0) of the others for one slope G."""
    base, k_r = river.law, river.k_r

    def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k: Symbol, b_d: Symbol, width: Symbol) -> Symbol:
        at, moves = vector(piece_point.py_func(piece, 0, u)), vector(piece_velocity.py_func(piece, 0, u))
        given = casadi.DM(slope) @ casadi.vertcat(p - at, v - moves)
        for cases in smooth:
            given += cases.force(p, v)
        for cases in switched:
            given += cases.force(at, moves)
        return base.force(p, v, piece, u, k, b_d, width) + k / k_r * given

    return base._replace(force=force)
