"""Certificates of a simulation defined in Python: of its field, including user-defined laws."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.added_laws import rivers_with
from controllers.certificates.loop.governed import governed_stability, with_damper
from controllers.certificates.loop.hand import HandImpedance, HandRange
from controllers.certificates.loop.law_cases import Cases, certified_cases, executed
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW, follow_law
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.loop.symbolic_execution import NotExecutable
from controllers.certificates.report import Verdict, hash_of, without_laws
from controllers.certificates.switching.common_lyapunov import common_lyapunov, contraction
from controllers.checks import check_kind, checked
from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError
from controllers.fields.algebra.instructions import Join
from controllers.fields.algebra.law import Law
from controllers.fields.algebra.weights import Weight
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.governor import Governor
from controllers.fields.orientation import Orientation
from controllers.fields.own.function_law import FunctionLaw
from experiments.certify.certified_device import phantom_device
from experiments.certify.executed_field import DEFAULT_REACH, check_executed
from experiments.config.keywords import with_keyword_messages
from experiments.config.run_config import phantom_of
from experiments.files.device_files import linkage_of
from experiments.runs.simulation import Simulation
from geometry.arrays import Array


@dataclass(frozen=True)
class SimulationCertificate:
    """Verdicts on a simulation's field.

    Attributes
    ----------
    stability : Verdict
        Stability of the sampled loop along the curve, with every hand of the range.
    passivity : Verdict
        Passivity of the loop at the stylus.
    inputs_hash : str
        Hash of all inputs of the verdicts.
    """

    stability: Verdict
    passivity: Verdict
    inputs_hash: str


class _ScaledPart(NamedTuple):
    """A law of a sum, or the force [N] and moment [N m] to which a part of it is limited, and its factor."""

    what: Law | tuple[float, ...]
    factor: float


class _FieldParts(NamedTuple):
    """The law that leads along a curve, user-defined laws and their factors, and the drag of a governor [N s/m]."""

    leading: Follow | Bunny
    added: tuple[tuple[FunctionLaw, float], ...]
    drag: float


@with_keyword_messages()
def certify(sim: Simulation, hands: HandRange | None = None, delay: float = 0.0) -> SimulationCertificate:
    """Certify a simulation's field: certified, refuted with a counterexample, or unknown with a reason.

    The field may be FOLLOW or a bunny, alone or with a governor, a moment on the stylus and user-defined laws, each
    times a number, and with a force limit. Any other law makes the verdicts unknown, and the reason names it. With
    user-defined laws, and with such other laws, the executed program is linearised in states about the curve, and
    stability is refuted if one of them is unstable.

    Parameters
    ----------
    sim : Simulation
        The simulation, of which field, clock and device are used.
    hands : HandRange, optional
        Intervals of the hand's impedance.
    delay : float
        Delay of the torques [s].

    Raises
    ------
    ParameterError
        If an argument is of another kind, the delay is negative or not finite, the simulation's hand is a replayed one,
        which feels no force, or a user-defined law raises or does not return three or six numbers.
    """
    check_kind("sim", sim, Simulation)
    check_kind("hands", hands, HandRange | None)
    checked("delay", delay, "s")
    phantom_of(sim.device)
    hands = hands or HandRange()
    inputs = hash_of((sim.field.description(), sim.clock, sim.device, hands, delay))
    laws = sim.field.program().laws
    own_laws = [law for law in laws if isinstance(law, FunctionLaw)]
    # The curve about which the field is examined: that of its leading law, or the map's.
    curves = [law.curve for law in laws if isinstance(law, Follow | Bunny)]
    curve: Trajectory | None = next(iter(curves), getattr(sim.haptic_map, "around", None))
    for law in own_laws if curve is not None else ():
        with suppress(NotExecutable):  # left by an earlier certificate; it makes this one unknown, below
            executed(law, curve)  # pyright: ignore[reportArgumentType]
    try:
        parts = _field_parts(sim.field)
        river = _certified_river(sim, parts.leading, delay)
        cases = [certified_cases(law, river.curve).scaled(factor) for law, factor in parts.added]
        rivers, assumptions = rivers_with(river, cases), _field_assumptions(sim.field, cases)
        stability = switched_stability(rivers, parts.drag, hands.hands())
        passivity_verdict = passivity(rivers[0] if len(rivers) == 1 else river)
    except ControllerError as error:
        unknown = Verdict("unknown", str(error))
        return SimulationCertificate(_check_executed(sim, curve, delay, unknown, hands), unknown, inputs)
    if own_laws:
        stability = (
            stability if stability.verdict == "refuted" else _check_executed(sim, curve, delay, stability, hands)
        )
        # The condition of passivity covers only the river's spring and damper.
        if passivity_verdict.verdict == "certified" or len(rivers) > 1:
            passivity_verdict = without_laws(passivity_verdict, [law.place for law in own_laws])
    return SimulationCertificate(
        _add_assumptions(stability, assumptions), _add_assumptions(passivity_verdict, assumptions), inputs
    )


def _check_executed(
    sim: Simulation, curve: Trajectory | None, delay: float, verdict: Verdict, hands: HandRange
) -> Verdict:
    """A verdict checked with the executed program about a curve."""
    if curve is None:
        return verdict
    reach = getattr(sim.haptic_map, "reach", DEFAULT_REACH)
    sampling = Sampling(sim.clock.servo_period, delay, phantom_of(sim.device).cutoff)
    place = CertifiedRiver(FOLLOW_LAW, 1.0, 0.0, float("inf"), curve, phantom_device(linkage_of(sim.device)), sampling)
    try:
        return check_executed(sim.field.program(), place, reach, verdict, hands)
    except NotExecutable:
        reason = "a user-defined law keeps numbers of the hand between calls"
        return Verdict("unknown", f"{verdict.reason}; {reason}" if verdict.verdict == "unknown" else reason)


def _certified_river(sim: Simulation, law: Follow | Bunny, delay: float) -> CertifiedRiver:
    """The law that leads along a curve, in the form that is certified."""
    if isinstance(law, Follow):
        base, k_r, b_d, width = follow_law(law.parallel_share), law.k_r, law.b_d, law.epsilon
    else:
        base, (k_r, b_d, width) = BUNNY_LAW, law.felt
        if law.attraction == "along":
            # Near a bunny that pulls along the curve, the field equals FOLLOW to first order.
            base, width = FOLLOW_LAW, float("inf")
    sampling = Sampling(sim.clock.servo_period, delay, phantom_of(sim.device).cutoff)
    return CertifiedRiver(base, k_r, b_d, width, law.curve, phantom_device(linkage_of(sim.device)), sampling)


def _split_sum(field: Law) -> list[_ScaledPart]:
    """A field as a sum: its laws and limits in order, each times a number."""
    stack: list[list[_ScaledPart]] = []
    for what, numbers in field.program().composition():
        if isinstance(what, Law):
            stack.append([_ScaledPart(what, 1.0)])
        elif what is Join.ADD:
            last = stack.pop()
            stack[-1] += last
        elif what is Join.LIMIT:
            stack[-1].append(_ScaledPart(tuple(numbers.tolist()), 1.0))
        elif what is Join.GATE and (factor := Weight(tuple(numbers.tolist())).factor) is not None:
            stack[-1] = [part._replace(factor=factor * part.factor) for part in stack[-1]]
        else:
            raise ControllerError("no certificate is known of a field that is gated or blended by a weight")
    return stack[0]


def _field_parts(field: Law) -> _FieldParts:
    scaled = _split_sum(field)
    laws = [part.what for part in scaled if isinstance(part.what, Law)]
    leading = [law for law in laws if isinstance(law, Follow | Bunny)]
    governors = [law for law in laws if isinstance(law, Governor)]
    known = (Follow, Bunny, FunctionLaw, Governor, Orientation)
    others = [type(law).__name__ for law in laws if not isinstance(law, known)]
    if len(leading) != 1 or others or len(governors) > 1:
        names = ", ".join(others) or ", ".join(type(law).__name__ for law in leading) or "no law along a curve"
        raise ControllerError(f"a certificate covers one FOLLOW or bunny, and user-defined laws; the field has {names}")
    if governors and not np.array_equal(governors[0].curve.packed(), leading[0].curve.packed()):
        raise ControllerError("a governor is certified on the curve of the law beside it; this one has another")
    for law, factor in scaled:
        if isinstance(law, Follow | Bunny | Governor) and factor < 0.0:
            raise ControllerError(
                f"no certificate is known of {type(law).__name__} times {factor:g}, which leads the hand away"
            )
    factors = {id(law): factor for law, factor in scaled}
    times = factors[id(leading[0])]
    leading_law = replace(leading[0], k_r=times * leading[0].k_r, b_d=times * leading[0].b_d)
    added = tuple((law, factor) for law, factor in scaled if isinstance(law, FunctionLaw))
    return _FieldParts(leading_law, added, sum(factors[id(law)] * law.drag for law in governors))


def _field_assumptions(field: Law, added: Sequence[Cases]) -> tuple[str, ...]:
    """Assumptions of a field's certificate due to its limits, its moments and its user-defined laws."""
    scaled = _split_sum(field)
    assumed = [
        f"the field stays below the {' and '.join(bounds)} to which it is cut"
        for what, factor in scaled
        if isinstance(what, tuple)
        and (
            bounds := [f"{abs(factor) * x:g} {unit}" for x, unit in zip(what, ("N", "N m"), strict=True) if x < np.inf]
        )
    ]
    if any(isinstance(what, Orientation) for what, _ in scaled) or any(cases.exerts_moment for cases in added):
        assumed.append("the moment on the stylus has no effect: the device's motors give a force only")
    if added:
        assumed.append("the critical gain is one by which the whole field is scaled, user-defined laws included")
    return tuple(assumed)


def _add_assumptions(verdict: Verdict, assumed: tuple[str, ...]) -> Verdict:
    return replace(verdict, assumptions=verdict.assumptions + assumed)


def switched_stability(rivers: Sequence[CertifiedRiver], drag: float, hands: Sequence[HandImpedance]) -> Verdict:
    """Verdict on a field that switches arbitrarily between rivers, with a governor of a drag [N s/m].

    Certified if every river is certified and, at every phase and with every hand, they have a common quadratic Lyapunov
    function. If a river is not stable the result is unknown, since a hand may be in that case too briefly to oscillate.
    A single river keeps its own verdict.
    """
    verdicts = [governed_stability(river, drag, hands) for river in rivers]
    if len(rivers) == 1:
        return verdicts[0]
    worst = min(verdicts, key=lambda verdict: np.inf if verdict.margin is None else verdict.margin)
    for verdict in verdicts:
        if verdict.verdict != "certified":
            reason = f"in one of {len(rivers)} cases of user-defined laws it is {verdict.verdict}: {verdict.reason}"
            return Verdict("unknown", reason, None, verdict.assumptions)
    uncovered = _first_without_common(rivers, drag, hands)
    if uncovered is not None:
        phase, hand = uncovered
        reason = (
            f"stable in each of {len(rivers)} cases of user-defined laws, but switching between them is not certified: "
            f"no common Lyapunov function was found at phase {phase:.3g} s with {hand}; {worst.reason}"
        )
        return Verdict("unknown", reason, None, worst.assumptions)
    reason = f"{worst.reason}, the least of {len(rivers)} cases of user-defined laws; so is any switching between them"
    return replace(worst, reason=reason)


def _first_without_common(
    rivers: Sequence[CertifiedRiver], drag: float, hands: Sequence[HandImpedance]
) -> tuple[float, HandImpedance] | None:
    """The first phase and hand with which no common Lyapunov function of the rivers was found; None if all have one."""
    governed = [
        river._replace(law=with_damper(river.law, drag, river.k_r, river.b_d)) for river in rivers if drag > 0.0
    ]
    for hand in hands:
        loops = [river.loop(hand) for river in (*rivers, *governed)]
        maps = np.stack([loop.frozen(rivers[0].k_r, rivers[0].b_d) for loop in loops], axis=1)
        last: Array | None = None
        for phase, phase_maps, basis in zip(rivers[0].phases().tolist(), maps, loops[0].across[0], strict=True):
            # The function of the previous phase, in the coordinates of this phase, usually serves here too.
            if last is not None:
                here = basis.T @ last @ basis
                if contraction(0.5 * (here + here.T), list(phase_maps)) < 1.0:
                    continue
            found = common_lyapunov(list(phase_maps))
            if found is None:
                return phase, hand
            last = basis @ found.p @ basis.T
    return None
