"""User-defined laws on CasADi symbols, added to the law that drives along a curve."""

from typing import Any

import casadi

from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.laws import Law
from controllers.errors import ControllerError
from controllers.fields.function_law import FunctionLaw
from controllers.state import HandState

_UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def with_added(base: Law, added: tuple[FunctionLaw, ...], k_r: float) -> Law:
    """A law plus the forces of user-defined functions, for an upright stylus that does not turn, with its switch open.

    Since a law must be linear in its gains, the added forces are scaled with the stiffness, F + (k/k_r) Σ F_i: at the
    field's own gains this is the field itself, and the search for a critical gain scales all of it.

    Parameters
    ----------
    base : Law
        The law that drives along the curve.
    added : tuple of FunctionLaw
        User-defined laws.
    k_r : float
        Stiffness of the field [N/m].

    Raises
    ------
    ControllerError
        If the stiffness is zero, or a function cannot be evaluated on symbols, as when it branches on the hand.
    """
    if not added:
        return base
    if k_r <= 0.0:
        raise ControllerError("a certificate of laws of one's own needs a stiffness k_r above zero beside them")
    # Evaluated once beforehand, so that a function that cannot be evaluated on symbols raises at once.
    _force(added, casadi.SX.sym("p", 3), casadi.SX.sym("v", 3))

    def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k: Symbol, b_d: Symbol, width: Symbol) -> Symbol:
        return base.force(p, v, piece, u, k, b_d, width) + k / k_r * _force(added, p, v)

    return base._replace(force=force)


def _force(added: tuple[FunctionLaw, ...], p: Symbol, v: Symbol) -> Symbol:
    place, velocity, none = (p[0], p[1], p[2]), (v[0], v[1], v[2]), (0.0, 0.0, 0.0)
    hand: Any = HandState(0.0, place, _UPRIGHT, velocity, none)  # pyright: ignore[reportArgumentType]
    return sum((vector(law.expression(hand)[:3]) for law in added), vector((0.0, 0.0, 0.0)))
