"""Cases of a user-defined law: symbolic execution of its function, with the conditions of each case."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import casadi
import numpy as np

from controllers.certificates.loop.device import Symbol, vector
from controllers.certificates.loop.hand_samples import sample_hands, state_text
from controllers.certificates.loop.symbolic_execution import (
    Condition,
    ExecutionPath,
    NotExecutable,
    SymbolicNumber,
    SymbolicVector,
    identical,
)
from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError, ParameterError
from controllers.fields.algebra.program import evaluate
from controllers.fields.own.compiled_law import CompiledLaw
from controllers.fields.own.function_law import FunctionLaw
from controllers.state import HandState
from geometry.arrays import Array, Mask

MAX_CASES = 16  # largest number of paths through a function: that of four independent comparisons
# Relative difference of two forces from the same operations in another order: rounding, magnified by cancellation.
_FORCE_TOLERANCE = 1e-9
_MIN_FORCE = 1e-12  # [N] smaller than any force
# Operations of CasADi without a derivative somewhere in the middle of their domain.
_NONSMOOTH_OPERATIONS = frozenset(
    (casadi.OP_FABS, casadi.OP_SIGN, casadi.OP_FMIN, casadi.OP_FMAX, casadi.OP_FLOOR, casadi.OP_CEIL, casadi.OP_FMOD,
     casadi.OP_IF_ELSE_ZERO, casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE, casadi.OP_COPYSIGN)
)  # fmt: skip


class Case(NamedTuple):
    """Force F [N] and moment [N m] of a law as expressions (3,), where all of the conditions hold."""

    force: Symbol
    moment: Symbol
    conditions: tuple[Condition, ...]


@dataclass(frozen=True, eq=False)
class Cases:
    """A law in the form that is certified: its cases, exactly one of which holds for any hand.

    Attributes
    ----------
    law : FunctionLaw
    p, v : Symbol
        Position [m] and velocity [m/s] of the hand in the expressions, (3,) each.
    cases : tuple of Case
    """

    law: FunctionLaw
    p: Symbol
    v: Symbol
    cases: tuple[Case, ...]

    @property
    def smooth(self) -> bool:
        """Whether the force is one expression for every hand."""
        return all(identical(case.force, self.cases[0].force) for case in self.cases)

    @property
    def exerts_moment(self) -> bool:
        """Whether there is a moment that is not zero for every hand."""
        return not all(case.moment.is_zero() for case in self.cases)

    @cached_property
    def chosen(self) -> Any:
        """CasADi function (p, v) → force (3,), NaN where no case holds, and the number of the case."""
        force, case_number = casadi.SX(np.full(3, np.nan)), casadi.SX(-1.0)
        for number, case in enumerate(self.cases):
            holds = casadi.SX(1.0)
            for condition in case.conditions:
                holds = casadi.logic_and(holds, condition.symbol())
            force, case_number = casadi.if_else(holds, case.force, force), casadi.if_else(holds, number, case_number)
        return casadi.Function("chosen", [self.p, self.v], [force, case_number])

    def scaled(self, factor: float) -> "Cases":
        """The law times a number, under the same conditions."""
        cases = [case._replace(force=factor * case.force, moment=factor * case.moment) for case in self.cases]
        return replace(self, cases=tuple(cases))

    def check_slopes(self, hands: Array) -> None:
        """Check that the force can be differentiated at hands (p, v), shape (n, 6), if it is `smooth`.

        Raises
        ------
        ControllerError
            If a derivative is not finite, such as that of a distance at zero.
        """
        x = casadi.vertcat(self.p, self.v)
        slope = casadi.Function("slope", [x], [casadi.densify(casadi.jacobian(self.cases[0].force, x))])
        wrong = ~np.isfinite(np.array([np.array(slope(hand)) for hand in hands])).all(axis=(1, 2))
        if wrong.any():
            at = hands[int(np.argmax(wrong))]
            raise ControllerError(
                f"the force of {self.law.place} has no derivative for a hand on the curve, at "
                f"{state_text(at[:3], at[3:])}"
            )

    def force(self, p: Symbol, v: Symbol) -> Symbol:
        """Force [N] as an expression of other symbols."""
        whole = self.cases[0].force if self.smooth else self.chosen(self.p, self.v)[0]
        return casadi.Function("force", [self.p, self.v], [whole])(p, v)


def cases_of(law: FunctionLaw) -> Cases:
    """Execute a law's function on symbols along every path that its comparisons allow.

    Raises
    ------
    ControllerError
        If it cannot be executed on symbols, has more than `MAX_CASES` paths, or its force depends on anything but the
        hand's position and velocity.
    """
    sym = casadi.SX.sym
    symbols = {name: sym(name, size) for name, size in (("t", 1), ("p", 3), ("q", 4), ("v", 3), ("w", 3), ("s", 1))}
    found, pending = list[Case](), [tuple[bool, ...]()]
    while pending:
        given = pending.pop()
        if len(found) == MAX_CASES:
            raise ControllerError(
                f"{law.place} has more than {MAX_CASES} cases; expected fewer comparisons, as all are certified"
            )
        path = ExecutionPath(given)
        wrench = _wrench_on_path(law, path, symbols)
        decisions = [condition.holds for condition in path.conditions]
        pending += [(*decisions[:at], not decisions[at]) for at in range(len(given), len(decisions))]
        found.append(Case(vector(wrench[:3]), vector(wrench[3:]), tuple(path.conditions)))
    _check_inputs(law, found, symbols)
    if any(_is_nonsmooth(case, casadi.vertcat(*symbols.values())) for case in found):
        raise ControllerError(f"the force of {law.place} has a kink without a comparison, as √x²; expected abs(x)")
    return Cases(law, symbols["p"], symbols["v"], tuple(found))


def _wrench_on_path(law: FunctionLaw, path: ExecutionPath, symbols: dict[str, Symbol]) -> list[Symbol]:
    """Six numbers of a law along one path; as in a run, vectors of the hand are arrays, or tuples if compiled."""

    def given(name: str) -> Any:
        numbers = SymbolicVector.of(symbols[name], path)
        return tuple(numbers) if isinstance(law, CompiledLaw) else numbers

    t, switch = (SymbolicNumber(symbols[name], path) for name in ("t", "s"))
    hand = HandState(t, given("p"), given("q"), given("v"), given("w"), switch)  # pyright: ignore[reportArgumentType]
    try:
        # An entry may be an array without dimensions, as from np.where.
        numbers = [np.asarray(item, dtype=object).item() for item in law.function(hand, **law.parameters)]  # pyright: ignore[reportGeneralTypeIssues]
        wrench = [item.symbol if isinstance(item, SymbolicNumber) else casadi.SX(float(item)) for item in numbers]
    except Exception as error:  # whatever a user's function raises
        why = path.lost or (str(error) if isinstance(error, NotExecutable) else f"{type(error).__name__}: {error}")
    else:
        why = path.lost or (None if len(wrench) in (3, 6) else f"it gives {len(wrench)} numbers; expected three or six")
        if why is None:
            return wrench + [casadi.SX(0.0)] * (6 - len(wrench))
    raise ControllerError(f"{law.place} cannot be evaluated symbolically: {why}")


def _is_nonsmooth(case: Case, x: Symbol) -> bool:
    """Whether an expression of a case has a kink or jump, such as |x|, to which CasADi simplifies √x²."""
    function = casadi.Function("case", [x], [case.force])
    return any(function.instruction_id(i) in _NONSMOOTH_OPERATIONS for i in range(function.n_instructions()))


def _check_inputs(law: FunctionLaw, cases: list[Case], symbols: dict[str, Symbol]) -> None:
    names = {"t": "the time", "q": "the orientation", "w": "the angular velocity", "s": "the switch"}
    read = casadi.vertcat(
        *(casadi.vertcat(case.force, *(condition.gap for condition in case.conditions)) for case in cases)
    )
    found = [words for name, words in names.items() if casadi.depends_on(read, symbols[name])]
    if found:
        raise ControllerError(
            f"the force of {law.place} depends on {' and '.join(found)} of the hand; a certificate covers forces that "
            "depend on its position and velocity alone"
        )


def executed(law: FunctionLaw, curve: Trajectory, backwards: bool = False) -> Array:
    """Six numbers of a law as a run evaluates it, at the hands about a curve, the last first if `backwards`; (n, 6).

    Raises
    ------
    NotExecutable
        If the function returns a symbol from an earlier symbolic execution.
    ParameterError
        If the function raises, or does not return three or six numbers.
    """
    program, hands = law.program(), sample_hands(curve)
    wrenches = np.empty((len(hands), 6))
    for hand, wrench in list(zip(hands, wrenches, strict=True))[:: -1 if backwards else 1]:
        memory = program.fresh_memory()
        try:
            program.feed(memory, hand)
            evaluate(*program.compiled(), memory, hand.vector(), wrench)
        except NotExecutable:
            raise NotExecutable(
                f"{law.place} keeps numbers of the hand between calls; a certificate covers functions of it alone"
            ) from None
        except ParameterError:
            raise
        except Exception as error:  # whatever a user's function raises
            raise ParameterError(
                f"{law.place} raised {type(error).__name__}: {error}; for a hand at {state_text(hand.p, hand.v)}"
            ) from error
    return wrenches


def certified_cases(law: FunctionLaw, curve: Trajectory) -> Cases:
    """Cases of a law, compared with the law as a run evaluates it at the hands about a curve.

    Raises
    ------
    ControllerError
        If the law cannot be executed on symbols (`cases_of`), or its numbers are not finite, change when it is
        evaluated again, or differ from those of its cases.
    ParameterError
        As `executed`.
    """
    force = executed(law, curve)[:, :3]
    _refuse_if(law, curve, np.asarray(~np.isfinite(force).all(axis=1), dtype=np.bool_), "numbers that are not finite")
    size = _FORCE_TOLERANCE * np.linalg.norm(force, axis=1) + _MIN_FORCE

    def differs(other: Array) -> Mask:
        difference = np.linalg.norm(other - force, axis=1)
        return np.isnan(difference) | (difference > size)

    _refuse_if(law, curve, differs(executed(law, curve, backwards=True)[:, :3]), "another force when called again")
    cases, hands = cases_of(law), sample_hands(curve)
    places, velocities = (np.array([getattr(hand, name) for hand in hands]).T for name in ("p", "v"))
    symbolic = np.array(cases.chosen.map(len(hands))(places, velocities)[0]).T
    _refuse_if(law, curve, differs(symbolic), "another force in a run than symbolically")
    return cases


def _refuse_if(law: FunctionLaw, curve: Trajectory, wrong: Mask, what: str) -> None:
    if wrong.any():
        hand = sample_hands(curve)[int(np.argmax(wrong))]
        raise ControllerError(
            f"{law.place} gives {what}, as for a hand at {state_text(hand.p, hand.v)}; a certificate covers "
            "functions of the hand alone"
        )
