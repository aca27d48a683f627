"""Cached stability verdicts of runs: files named by a hash of all inputs, for callers that ask many times."""

import json
from contextlib import suppress
from dataclasses import asdict, dataclass

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import FROM_WORST, Outcome, Verdict, hash_of, without_laws
from controllers.errors import ControllerError
from experiments.certify.certified_field import certificate_inputs
from experiments.config.run_config import RunConfig
from experiments.setups.certified_law import governor_drag, uncertified_parts
from experiments.setups.parts.defaults import resolved
from geometry.whole_files import atomic_file
from sim.compilation.sources import results_folder

_LEADING_REASON = "leading is certified per regime, for the led clip: hvf certify --mode lead"


@dataclass(frozen=True)
class Stability:
    """Verdict on the stability of a run's loop, with every hand of the default range.

    Attributes
    ----------
    verdict : {"certified", "refuted", "unknown"}
        The worst verdict of the laws that the run uses.
    margin : float or None
        Smallest margin (critical k_r)/k_r − 1 of these laws; None if there is no certificate.
    reason : str
        Reason of the worst verdict.
    """

    verdict: Outcome
    margin: float | None
    reason: str

    @property
    def used(self) -> float:
        """k_r over the critical k_r: 0 for no stiffness, 1 at the boundary; NaN where there is no certificate."""
        return float("nan") if self.margin is None else 1.0 / max(1.0 + self.margin, 1e-9)


def cached_stability(config: RunConfig) -> Stability:
    """Certify the stability of a run, or return the cached verdict for the same inputs and code."""
    config, hands = resolved(config), HandRange()
    if config.leads:
        return Stability("unknown", None, _LEADING_REASON)
    try:
        inputs = certificate_inputs(config, 0.0, hands, 1.0)
    except ControllerError as error:
        return Stability("unknown", None, str(error))
    file = results_folder(__name__) / f"stability-{hash_of(inputs)}.json"
    with suppress(OSError, ValueError, TypeError):
        return Stability(**json.loads(file.read_text(encoding="utf-8")))
    found = _certify_stability(config, hands)
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(file) as draft:
            draft.write(json.dumps(asdict(found)).encode())
    return found


def stability_of_laws(config: RunConfig, hands: HandRange) -> dict[str, Verdict]:
    """Verdicts on the stability of a run's laws, by their names in `certified_laws`; raises as `certified_rivers`."""
    from controllers.certificates.loop.governed import governed_stability  # imported late: loads CasADi
    from experiments.certify.certify import certified_rivers

    drag, missing = governor_drag(config), uncertified_parts(config)
    verdicts = {name: governed_stability(it, drag, hands.hands()) for name, it in certified_rivers(config).items()}
    return {name: without_laws(it, missing) for name, it in verdicts.items()} if missing else verdicts


def _certify_stability(config: RunConfig, hands: HandRange) -> Stability:
    try:
        verdicts = stability_of_laws(config, hands).values()
    except ControllerError as error:
        return Stability("unknown", None, str(error))
    worst = min(verdicts, key=lambda verdict: FROM_WORST.index(verdict.verdict))
    margin = min((verdict.margin for verdict in verdicts if verdict.margin is not None), default=None)
    return Stability(worst.verdict, margin, worst.reason)
