"""Stability checks by linearising the executed program, walls included, for fields that no certificate covers."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.certificates.loop.executed import WorstState, examine_curve, examine_random_states
from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.hand_samples import state_text
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.certificates.report import Verdict
from controllers.fields.algebra.law import Program
from controllers.safety.limiter import ForceLimiter
from experiments.config.run_config import RunConfig
from experiments.setups.setups import map_parts, parts_of
from models.mocap.motion.clip import Clip
from sim.world.world import World

DEFAULT_REACH = 0.025  # [m] for maps without a reach
MAX_OFFSET_FRACTION = 0.2  # fraction of the map's reach: distance off the curve to which pushes bring a hand
MAX_SPEED_RATIO = 2.0  # speed of a hand that pushes forwards at the edge of the map, relative to the curve's


def walled(
    config: RunConfig, main: CertifiedRiver, verdict: Verdict, hands: HandRange, clips: Sequence[Clip]
) -> Verdict:
    """A verdict that omits walls, complemented by a check of the executed program (`check_executed`)."""
    parts = parts_of(config, map_parts(config, World(config.scene, config.body).body, tuple(clips) or None))
    reach = float(getattr(parts.maps, "reach", DEFAULT_REACH))
    return check_executed(parts.program, main._replace(curve=parts.course), reach, verdict, hands)


def check_executed(program: Program, main: CertifiedRiver, reach: float, verdict: Verdict, hands: HandRange) -> Verdict:
    """A verdict after a check of the program: refuted if it is unstable in a state about the curve of `main`."""
    examined = [
        examine_curve(program, main, MAX_OFFSET_FRACTION * reach, hands.hands()),
        examine_random_states(program, main, hands.hands()),
    ]
    found, strongest = max(examined, key=lambda it: it.radius), max(it.strongest for it in examined)
    figures = {**verdict.figures, "executed_radius": found.radius, "executed_force": strongest}
    if found.radius >= 1.0:
        reason = (
            f"unstable, by a factor of {found.radius:.4g} a period, for a hand {_place(main, found)}; {verdict.reason}"
        )
        case: dict[str, object] = {
            "phase": found.phase, "p": found.p, "v": found.v, "hand": found.hand, "radius": found.radius
        }  # fmt: skip
        return Verdict("refuted", reason, None, verdict.assumptions, case, figures)
    peak = ForceLimiter(main.sampling.period).peak
    limit_text = f", its force up to {strongest:.3g} N, which the limiter cuts" if strongest > peak else ""
    abrupt = [at for it in examined for at in it.abrupt]
    judged = sum(it.states for it in examined) - len(abrupt)
    summary = (
        f"no oscillation grows at {judged} states of the program{limit_text}" if judged else "no state can be judged"
    )
    if abrupt:
        summary += f"; at {len(abrupt)} more, as at {state_text(abrupt[0])}, its force jumps, is kinked or is no number"
    far = examine_curve(program, main, reach, hands.hands(), MAX_SPEED_RATIO)
    if far.radius >= 1.0:
        summary += f", but not for a hand {_place(main, far)}"
    return replace(verdict, reason=f"{verdict.reason}; {summary}", figures=figures)


def _place(main: CertifiedRiver, found: WorstState) -> str:
    off, speed = 1e3 * np.linalg.norm(found.p - main.curve.point(found.phase)), np.linalg.norm(found.v)
    return f"{off:.2g} mm off the curve at phase {found.phase:.3g} s with {speed:.3g} m/s"
