"""Certificates of the rivers of a run: stability of each, and of switching between them where they meet."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import permutations
from typing import NamedTuple

import mujoco
import numpy as np

from controllers.certificates.loop.device import Device
from controllers.certificates.loop.hand import HandImpedance, HandRange
from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver, stability
from controllers.certificates.report import Verdict
from controllers.certificates.switching.common_lyapunov import Common, common_lyapunov
from controllers.certificates.switching.switching import HandRetention, SelectionRule, competing_river, switching
from controllers.certificates.switching.switching_search import Course, Push, counterexample
from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.fields.algebra.program import evaluate
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder
from controllers.safety.limiter import ForceLimiter
from controllers.state import POSITION
from experiments.certify.certified_field import given_curves
from experiments.certify.trial_simulation import trial_model
from experiments.config.modes import Rivers
from experiments.config.run_config import RunConfig
from experiments.setups.modes.lifted_runs import lifted_river, side_by_side
from experiments.setups.modes.rivers import default_choice, law_of
from geometry.arrays import Array
from sim.world.phantom_port import actuate, phantom_port, sense, sensed_before
from sim.world.world import place_stylus

SUBSTEPS = 8


class Meeting(NamedTuple):
    """Two rivers, by index, and the phase on the first [s] at which it is nearest to the second."""

    own: int
    other: int
    phase: float


def certified_bundle(bundle: RiverBundle, device: Device, sampling: Sampling) -> tuple[CertifiedRiver, ...]:
    """The rivers of a bundle, in the form that certificates take."""
    return tuple(
        CertifiedRiver(FOLLOW_LAW, r.drag / r.tau, r.drag, r.epsilon, r.curve, device, sampling) for r in bundle.rivers
    )


def meetings(rivers: Sequence[CertifiedRiver]) -> list[Meeting]:
    """Meetings of all ordered pairs of rivers with overlapping tubes, at the phase where their curves are nearest."""
    found: list[Meeting] = []
    for i, j in permutations(range(len(rivers)), 2):
        distance = competing_river(rivers[i], rivers[j]).distance
        if distance.min() < rivers[i].width + rivers[j].width:
            found.append(Meeting(i, j, float(rivers[i].phases()[int(distance.argmin())])))
    return found


def held_common(rivers: Sequence[CertifiedRiver], place: Meeting, hands: HandRange, crossing: str) -> Common | None:
    """Common Lyapunov function where two rivers meet, for a hand in the middle of a range that stays there.

    It is common to the loops with either river, with none and, if rivers are summed, with both. So the state decays
    under any switching and blending of them. None if none was found, or the hand has no stiffness.
    """
    hand = HandImpedance(*(0.5 * (low + high) for low, high in (hands.mass, hands.damping, hands.stiffness)))
    if hand.stiffness == 0.0:
        return None
    maps: list[Array] = []
    feedback: list[Array] = []
    for number in (place.own, place.other):
        river = rivers[number]
        here = rivers[place.own].curve.point(place.phase)
        near = int(np.argmin(np.linalg.norm(river.curve.point(river.phases()) - here, axis=1)))
        loop = river.loop(hand)
        free = loop.matrices(0.0, 0.0)[near]
        feedback.append(loop.matrices(river.k_r, river.b_d)[near] - free)
        maps.append(free)
    vertices = [maps[0], maps[0] + feedback[0], maps[0] + feedback[1]]
    return common_lyapunov([*vertices, maps[0] + feedback[0] + feedback[1]] if crossing == "sum" else vertices)


def certify_rivers(
    config: RunConfig,
    mode: Rivers,
    main: CertifiedRiver,
    hands: HandRange,
    push: float,
    curves: Mapping[str, Trajectory],
) -> dict[str, Verdict]:
    """Verdicts on the stability of the rivers of a run besides the first, and on switching between all of them.

    Parameters
    ----------
    config, mode : RunConfig, Rivers
        Configuration of the run, and its mode.
    main : CertifiedRiver
        The river on which the run begins.
    hands : HandRange
        As in `stability`.
    push : float
        Largest force of the hand [N].
    curves : mapping of str to Trajectory
        Curves of the rivers, beginning with that of `main`; a single one means the default rivers about it.
    """
    sampling, ceiling = main.sampling, ForceLimiter(main.sampling.period).peak
    if len(curves) > 1:
        # The river on which the run begins comes first.
        names = tuple(name.removeprefix("_") or "first" for name in curves)
        bundle = RiverBundle(tuple(lifted_river(curve, mode) for curve in curves.values()), names)
        choice = side_by_side(bundle, tuple(curves.values()))
    else:
        choice = default_choice(mode, given_curves(config)[""], getattr(config.map, "reach", 0.0))
    bundle = choice.bundle
    rivers = certified_bundle(bundle, main.device, sampling)
    names = tuple(zip(bundle.names, rivers, strict=True))[1:]
    verdicts = {f"stability_{name}": stability(river, hands.hands()) for name, river in names}
    places = meetings(rivers)
    common = held_common(rivers, places[0], hands, mode.crossing) if places else None
    field = law_of(mode, choice)
    if isinstance(field, HigherOrder):
        found = _find_counterexample(field, rivers, places, push)
        sharing = SelectionRule(field.admission, field.sigma, field.hysteresis, field.form, field.look)
        retentions = [HandRetention(r, tuple(other for other in rivers if other is not r), sharing) for r in rivers]
        return verdicts | {"switching": switching(retentions, push, ceiling, found, common)}
    return verdicts | {"switching": _summed_verdict(common)}


def _find_counterexample(
    field: HigherOrder, rivers: Sequence[CertifiedRiver], places: Sequence[Meeting], push: float
) -> dict[str, object]:
    """First counterexample to switching at any meeting, without a push first; empty if torques are delayed."""
    if rivers[0].sampling.delay > 0.0:
        return {}
    simulate = partial(simulated_course, field, rivers[0].sampling)
    for newtons in dict.fromkeys((0.0, push)):
        for place in places:
            held, other = rivers[place.own], rivers[place.other]
            grid = other.phases()
            near = int(np.argmin(np.linalg.norm(other.curve.point(grid) - held.curve.point(place.phase), axis=1)))
            towards = other.curve.velocity(grid[near])
            found = counterexample(field, place.own, held, place.phase, towards, (newtons,), simulate)
            if found:
                return found
    return {}


def _summed_verdict(common: Common | None) -> Verdict:
    """Verdict on summed rivers: nothing switches, but a hand enters and leaves their windows."""
    if common is None:
        return Verdict("unknown", "no common Lyapunov function of the rivers, of none and of both was found")
    reason = (
        f"a hand that holds on settles however rivers come and go: a common Lyapunov function, ρ = {common.rate:.4g}"
    )
    assumptions = ("a hand in the middle of its range stays where two rivers are nearest", "linear, in that place")
    return Verdict("certified", reason, 1.0 - common.rate, assumptions, {}, {"common_p": common.p})


def simulated_course(
    field: HigherOrder, sampling: Sampling, start: Array, velocity: Array, seconds: float, push: Push | None
) -> Course:
    """`switching_search.course` with the full linkage in MuJoCo, including Coulomb friction, weight and encoders.

    Sensing, law and actuation are the servo's kernels, called tick by tick. The push acts through the motors.
    """
    model = trial_model(HandImpedance(), sampling.period / SUBSTEPS, True, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    data = mujoco.MjData(model)
    port = phantom_port(model, data, sampling.period, sampling.cutoff)
    place_stylus(model, data, start, v_H=velocity)
    mujoco.mj_forward(model, data)
    # The velocity filter starts settled at the initial velocity.
    sensed_before(port, data.qpos[list(port.arm_q)], data.qvel[list(port.arm_v)])
    program = field.program()
    memory, wrench = program.fresh_memory(), np.zeros(6)
    n = round(seconds / sampling.period)
    p, river = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        t = k * sampling.period
        sense(port, t, 0.0)
        evaluate(*program.compiled(), memory, port.hand, wrench)
        p[k], river[k] = port.hand[POSITION], memory[TRACE_RIVER]
        force = wrench[:3].copy()
        if push is not None and push.start <= t < push.start + push.duration:
            force += push.force
        actuate(port, force)
        mujoco.mj_step(model, data, SUBSTEPS)
    return Course(p, river)
