"""User-defined laws on CasADi symbols, added to the law that drives along a curve."""

from typing import Any

import casadi

from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.laws import Law
from controllers.errors import ControllerError
from controllers.fields.own.function_law import FunctionLaw
from controllers.state import HandState


def with_added(base: Law, added: tuple[FunctionLaw, ...], k_r: float) -> Law:
    """A law plus the forces of user-defined functions of the hand's position and velocity.

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
        If the stiffness is zero, a function cannot be evaluated on symbols, as when it branches on the hand, or its
        force depends on anything but the hand's position and velocity.
    """
    if not added:
        return base
    if k_r <= 0.0:
        raise ControllerError("a certificate of laws of one's own needs a stiffness k_r above zero beside them")
    # Evaluated once beforehand, so that a function of which nothing can be certified raises at once.
    for law in added:
        _check(law)

    def force(p: Symbol, v: Symbol, piece: Symbol, u: Symbol, k: Symbol, b_d: Symbol, width: Symbol) -> Symbol:
        return base.force(p, v, piece, u, k, b_d, width) + k / k_r * _force(added, p, v)

    return base._replace(force=force)


def exert_moments(added: tuple[FunctionLaw, ...]) -> bool:
    """Whether a function returns a moment that is not zero for every hand.

    Raises
    ------
    ControllerError
        If a function cannot be evaluated on symbols.
    """
    hand, _ = _symbolic_hand()
    return any(not casadi.SX(number).is_zero() for law in added for number in law.expression(hand)[3:])


def _symbolic_hand() -> tuple[HandState, dict[str, Symbol]]:
    """A hand of which every number is a symbol, and those that a certificate knows nothing of, by their name."""
    sym = casadi.SX.sym
    time, q, w, switch = sym("t"), sym("q", 4), sym("w", 3), sym("switch")
    hand: Any = HandState(time, _tuple(sym("p", 3)), _tuple(q), _tuple(sym("v", 3)), _tuple(w), switch)  # pyright: ignore[reportArgumentType]
    return hand, {"the time": time, "the orientation": q, "the angular velocity": w, "the switch": switch}


def _check(law: FunctionLaw) -> None:
    hand, unknown = _symbolic_hand()
    force = vector(law.expression(hand)[:3])
    found = [name for name, symbol in unknown.items() if casadi.depends_on(force, symbol)]
    if found:
        raise ControllerError(
            f"the force of {law.place} depends on {' and '.join(found)} of the hand; a certificate is of forces that "
            "depend on its position and velocity alone"
        )


def _tuple(symbol: Symbol) -> tuple[Symbol, ...]:
    return tuple(symbol[i] for i in range(symbol.numel()))


def _force(added: tuple[FunctionLaw, ...], p: Symbol, v: Symbol) -> Symbol:
    # `_check` has shown that no force depends on the other numbers of this hand.
    hand, _ = _symbolic_hand()
    hand = hand._replace(p=_tuple(p), v=_tuple(v))
    return sum((vector(law.expression(hand)[:3]) for law in added), vector((0.0, 0.0, 0.0)))
