"""Stability verdicts on the gains of a run, fast enough to follow a slider.

The verdict is that of `controllers.certificates.loop.stability.stability` at these gains, with the cheap steps first:
the loops of all hands do not depend on the gains and are cached, so that a verdict needs only their eigenvalues at one
pair of gains; the margin, which needs a search, is found afterwards.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from controllers.certificates.loop.governed import max_drag
from controllers.certificates.loop.hand import MAX_STIFFNESS, HandRange
from controllers.certificates.loop.passivity import passivity
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import River, critical_stiffness, lap_multipliers
from controllers.certificates.report import Outcome, Verdict, without_laws
from controllers.errors import ControllerError
from experiments.certify.certify import certified_rivers
from experiments.config.run_config import RunConfig
from experiments.setups.certified_law import certified_laws, governor_drag, uncertified_parts
from sim.errors import SimError


class GainVerdict(NamedTuple):
    """Verdict on the gains of a law.

    Attributes
    ----------
    law : str
        Name of the law: "field", "held tube", "performance".
    verdict : {"certified", "refuted", "unknown"}
        Verdict on linear stability along the curve, taking account of all laws that the run executes.
    reason : str
        Reason in one line.
    margin : float or None
        (critical k_r)/k_r − 1; None while it is being computed.
    passive : str
        Verdict on passivity, with its reason.
    """

    law: str
    verdict: Outcome
    reason: str
    margin: float | None
    passive: str


_LAW_NAMES = {"": "field", "_held": "held tube", "_then": "performance"}
_MIN_STIFFNESS = 1e-3  # [N/m] smallest stiffness for which the margin is computed


class GainVerdicts:
    """Verdicts on the gains of runs, with caches of loops, verdicts and critical gains."""

    def __init__(self) -> None:
        self._loops: dict[object, tuple[list[SampledLoop], list[SampledLoop]]] = {}
        self._verdicts: dict[object, GainVerdict] = {}
        self._critical: dict[object, float] = {}

    def of(self, config: RunConfig) -> Iterator[tuple[GainVerdict, ...]]:
        """Yield the verdicts on all laws of a run: first without margins, as soon as they are known, then with them."""
        try:
            if any(law.law == "leading" for law in certified_laws(config).values()):
                reason = "for a led figure this takes too long here; use hvf certify --mode lead"
                yield (GainVerdict("field", "unknown", reason, None, ""),)
                return
            rivers, drag, missing = certified_rivers(config), governor_drag(config), uncertified_parts(config)
        except (ControllerError, SimError) as error:
            yield (GainVerdict("field", "unknown", str(error), None, ""),)
            return
        for verdict_of in (self._cached_verdict, self._verdict_with_margin):
            found = ((river, verdict_of(name, river)) for name, river in rivers.items())
            verdicts = (
                verdict if drag == 0.0 else self._governed_verdict(river, drag, verdict) for river, verdict in found
            )
            yield tuple(verdict if not missing else _without_laws(verdict, missing) for verdict in verdicts)

    def _cached_verdict(self, name: str, river: River) -> GainVerdict:
        key = (name, *_key(river), river.k_r, river.b_d)
        if key not in self._verdicts:
            self._verdicts[key] = self._compute_verdict(name, river)
        return self._verdicts[key]

    def _compute_verdict(self, name: str, river: River) -> GainVerdict:
        law, (still, moving) = _LAW_NAMES.get(name, name.strip("_")), self._river_loops(river)
        gains, passive = f"k = {river.k_r:g} N/m, b = {river.b_d:g} N s/m", passivity(river)
        remark = f"{passive.verdict}: {passive.reason}"
        radii = np.array([loop.radius(river.k_r, river.b_d) for loop in still])
        if radii.max() >= 1.0:
            hand, at = np.unravel_index(int(radii.argmax()), radii.shape)
            rate = np.log(radii.max()) / river.sampling.period
            where = f"phase {river.phases()[at]:.2f} s with {HandRange().hands()[hand]}"
            return GainVerdict(law, "refuted", f"grows by e in {1e3 / rate:.3g} ms at {where}; {gains}", None, remark)
        multiplier = max((float(np.abs(lap_multipliers(river, loop.linear)[0])) for loop in moving), default=0.0)
        if multiplier >= 1.0:
            reason = f"stable with the phase held, but a multiplier of the lap is {multiplier:.4g}; {gains}"
            return GainVerdict(law, "unknown", reason, None, remark)
        bound = (np.maximum(radii[:, 1:], radii[:, :-1]) + np.abs(np.diff(radii, axis=1))).max()
        if bound >= 1.0:
            return GainVerdict(
                law, "unknown", f"near the boundary, between two phases of the grid; {gains}", None, remark
            )
        return GainVerdict(law, "certified", f"decays at every phase, with every hand; {gains}", None, remark)

    def _verdict_with_margin(self, name: str, river: River) -> GainVerdict:
        verdict = self._cached_verdict(name, river)
        if verdict.verdict == "refuted":
            return verdict
        key = (name, *_key(river), river.k_r, river.b_d)
        if key not in self._critical:
            still, min_stiffness = self._river_loops(river)[0], max(river.k_r, _MIN_STIFFNESS)
            self._critical[key] = min(float(critical_stiffness(loop, river.b_d, min_stiffness).min()) for loop in still)
        return verdict._replace(margin=min(self._critical[key], MAX_STIFFNESS) / max(river.k_r, _MIN_STIFFNESS) - 1.0)

    def _governed_verdict(self, river: River, drag: float, field_verdict: GainVerdict) -> GainVerdict:
        """The verdict on a river with a governor of a given drag [N s/m], by the circle criterion alone."""
        if field_verdict.verdict != "certified":
            return field_verdict
        certified_drag = min(max_drag(loop, river.k_r, river.b_d) for loop in self._river_loops(river)[0])
        remark = f"governor of {drag:g} N s/m, certain up to {certified_drag:.3g}"
        margin = None if field_verdict.margin is None else min(field_verdict.margin, certified_drag / drag - 1.0)
        if certified_drag > drag:
            return field_verdict._replace(reason=f"{field_verdict.reason}; {remark}", margin=margin)
        reason = f"{remark}; hvf certify says whether it oscillates; {field_verdict.reason}"
        return field_verdict._replace(verdict="unknown", reason=reason, margin=margin)

    def _river_loops(self, river: River) -> tuple[list[SampledLoop], list[SampledLoop]]:
        key = _key(river)
        if key not in self._loops:
            hands = HandRange().hands()
            still = [SampledLoop(river.still(hand), river.sampling) for hand in hands]
            carries = river.curve.periodic and river.law.carries
            self._loops[key] = still, [SampledLoop(river.moving(hand), river.sampling) for hand in hands if carries]
        return self._loops[key]


def _without_laws(verdict: GainVerdict, laws: Sequence[str]) -> GainVerdict:
    combined = without_laws(Verdict(verdict.verdict, verdict.reason), laws)
    return verdict._replace(verdict=combined.verdict, reason=combined.reason)


def _key(river: River) -> tuple[object, ...]:
    curve = river.curve
    return (
        river.law,
        river.width,
        river.sampling,
        curve.periodic,
        *(np.asarray(a).tobytes() for a in (curve.positions, curve.times)),
    )
