"""Certificates of a simulation from Python: of its very field, laws of one's own included."""

from dataclasses import dataclass
from typing import NamedTuple

from controllers.certificates.loop.added_laws import with_added
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.laws import BUNNY_LAW, FOLLOW_LAW
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import River, stability
from controllers.certificates.report import Verdict, hash_of
from controllers.errors import ControllerError
from controllers.fields.bunny import Bunny
from controllers.fields.follow import Follow
from controllers.fields.function_law import FunctionLaw
from controllers.fields.instructions import Join
from controllers.fields.law import Law
from experiments.certify.certified_device import phantom_device
from experiments.simulation import Simulation


@dataclass(frozen=True)
class SimulationCertificate:
    """What is certain of a simulation's field.

    Attributes
    ----------
    stability : Verdict
        Of the sampled loop along the curve, with every hand of the range.
    passivity : Verdict
        As the hand meets it, beside stability.
    inputs_hash : str
        Of all that they depend on.
    """

    stability: Verdict
    passivity: Verdict
    inputs_hash: str


class _Parts(NamedTuple):
    """The law that drives along a curve, and the others, whose forces are added."""

    leading: Follow | Bunny
    added: tuple[FunctionLaw, ...]


def certify(sim: Simulation, hands: HandRange | None = None, delay: float = 0.0) -> SimulationCertificate:
    """Say what is certain of a simulation's field: certified, refuted with a counterexample, or unknown with why.

    The field may be FOLLOW or a bunny, alone or with laws of one's own added, and cut to a force. What else it is made
    of makes the verdicts unknown, by name.

    Parameters
    ----------
    sim : Simulation
        Whose field, clock and device they are.
    hands : HandRange, optional
        Intervals of the hand's impedance.
    delay : float
        Of the torques [s].
    """
    hands = hands or HandRange()
    inputs = hash_of((sim.field.description(), sim.clock, sim.device, hands, delay))
    try:
        river, assumed = _river(sim, delay)
    except ControllerError as error:
        unknown = Verdict("unknown", str(error))
        return SimulationCertificate(unknown, unknown, inputs)
    return SimulationCertificate(
        _assuming(stability(river, hands.hands()), assumed), _assuming(passivity(river), assumed), inputs
    )


def _river(sim: Simulation, delay: float) -> tuple[River, tuple[str, ...]]:
    parts, assumed = _parts_of(sim.field)
    if parts.added:
        assumed += ("the critical gain is one by which the whole field is scaled, laws of one's own included",)
    law, curve = parts.leading, parts.leading.curve
    if isinstance(law, Follow):
        base, width = FOLLOW_LAW, law.epsilon
    else:
        # Near a bunny that pulls along the curve the field is FOLLOW's, to first order.
        base, width = (BUNNY_LAW, law.delta) if law.attraction == "point" else (FOLLOW_LAW, float("inf"))
    sampling = Sampling(sim.clock.servo_period, delay, sim.device.cutoff)
    return River(
        with_added(base, parts.added, law.k_r), law.k_r, law.b_d, width, curve, phantom_device(), sampling
    ), assumed


def _parts_of(field: Law) -> tuple[_Parts, tuple[str, ...]]:
    program, assumed = field.program(), list[str]()
    for what, numbers in program.composition():
        if what is Join.LIMIT:
            assumed.append(f"the field stays below the {numbers[0]:g} N and {numbers[1]:g} N m to which it is cut")
        elif what in (Join.GATE, Join.BLEND):
            raise ControllerError("no certificate is known of a field that is gated or blended by a weight")
    leading = [law for law in program.laws if isinstance(law, Follow | Bunny)]
    added = tuple(law for law in program.laws if isinstance(law, FunctionLaw))
    others = [type(law).__name__ for law in program.laws if law not in leading and law not in added]
    if len(leading) != 1 or others:
        names = ", ".join(others) or ", ".join(type(law).__name__ for law in leading) or "no law along a curve"
        raise ControllerError(f"a certificate is of one FOLLOW or bunny, and laws of one's own; the field has {names}")
    return _Parts(leading[0], added), tuple(assumed)


def _assuming(verdict: Verdict, assumed: tuple[str, ...]) -> Verdict:
    return Verdict(
        verdict.verdict, verdict.reason, verdict.margin, verdict.assumptions + assumed, verdict.counterexample,
        verdict.figures,
    )  # fmt: skip
