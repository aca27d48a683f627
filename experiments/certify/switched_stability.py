"""Stability of a field whose laws switch between linear cases: each by itself, and every change between them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.certificates.loop.governed import governed_stability, with_damper
from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import River
from controllers.certificates.report import Verdict
from controllers.certificates.switching.common_lyapunov import common_lyapunov, contraction
from controllers.state import Array


def switched_stability(rivers: Sequence[River], drag: float, hands: Sequence[HandImpedance]) -> Verdict:
    """Verdict on a field that switches arbitrarily between rivers, with a governor of a drag [N s/m].

    Certified if every river is, and at every phase, with every hand, they have a common quadratic Lyapunov function.
    A river that is not stable leaves the field unknown: a hand may be in that case too briefly to shake. Of a single
    river the verdict is its own.
    """
    verdicts = [governed_stability(river, drag, hands) for river in rivers]
    if len(rivers) == 1:
        return verdicts[0]
    worst = min(verdicts, key=lambda verdict: np.inf if verdict.margin is None else verdict.margin)
    for verdict in verdicts:
        if verdict.verdict != "certified":
            reason = f"in one of {len(rivers)} cases of laws of one's own it is {verdict.verdict}: {verdict.reason}"
            return Verdict("unknown", reason, None, verdict.assumptions)
    missing = _uncommon(rivers, drag, hands)
    if missing is not None:
        phase, hand = missing
        reason = (
            f"stable in each of {len(rivers)} cases of laws of one's own, but switching between them is not certified: "
            f"no common Lyapunov function was found at phase {phase:.3g} s with {hand}; {worst.reason}"
        )
        return Verdict("unknown", reason, None, worst.assumptions)
    reason = f"{worst.reason}, the least of {len(rivers)} cases of laws of one's own; so is any switching between them"
    return replace(worst, reason=reason)


def _uncommon(
    rivers: Sequence[River], drag: float, hands: Sequence[HandImpedance]
) -> tuple[float, HandImpedance] | None:
    """The first phase and hand with which no common Lyapunov function of the rivers was found; None if all have one."""
    acting = [river._replace(law=with_damper(river.law, drag, river.k_r, river.b_d)) for river in rivers if drag > 0.0]
    for hand in hands:
        loops = [SampledLoop(river.still(hand), river.sampling) for river in (*rivers, *acting)]
        maps = np.stack([loop.frozen(rivers[0].k_r, rivers[0].b_d) for loop in loops], axis=1)
        last: Array | None = None
        for phase, at, basis in zip(rivers[0].phases().tolist(), maps, loops[0].across[0], strict=True):
            # Mostly the function of the phase before is one here, too, in the coordinates of this phase.
            if last is not None and contraction(_symmetric(basis.T @ last @ basis), list(at)) < 1.0:
                continue
            found = common_lyapunov(list(at))
            if found is None:
                return phase, hand
            last = basis @ found.p @ basis.T
    return None


def _symmetric(p: Array) -> Array:
    return 0.5 * (p + p.T)
