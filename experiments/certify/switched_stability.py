"""Stability of a field whose laws switch between linear cases: each case by itself, and any switching between them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.certificates.loop.governed import governed_stability, with_damper
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import River
from controllers.certificates.report import Verdict
from controllers.certificates.switching.common_lyapunov import common_lyapunov, contraction
from geometry.arrays import Array


def switched_stability(rivers: Sequence[River], drag: float, hands: Sequence[HandImpedance]) -> Verdict:
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
    rivers: Sequence[River], drag: float, hands: Sequence[HandImpedance]
) -> tuple[float, HandImpedance] | None:
    """The first phase and hand with which no common Lyapunov function of the rivers was found; None if all have one."""
    governed = [
        river._replace(law=with_damper(river.law, drag, river.k_r, river.b_d)) for river in rivers if drag > 0.0
    ]
    for hand in hands:
        loops = [SampledLoop(river.still(hand), river.sampling) for river in (*rivers, *governed)]
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
