"""Verdicts on the gains of a run beside their sliders: those of its certificate."""

from typing import NamedTuple

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import Verdict
from controllers.errors import ControllerError
from experiments.config.run_config import RunConfig
from sim.errors import SimError


class GainVerdict(NamedTuple):
    """Verdicts on the gains of a law: its name ("field", "held tube", "performance"), stability, and passivity."""

    law: str
    stability: Verdict
    passivity: Verdict | None


_LAW_NAMES = {"": "field", "_held": "held tube", "_then": "performance"}


def gain_verdicts(config: RunConfig) -> tuple[GainVerdict, ...]:
    """Verdicts on all laws of a run, taking account of all that the run executes."""
    # Imported here: they load CasADi, which the page's process does without.
    from controllers.certificates.loop.passivity import passivity
    from experiments.certify.cached_stability import stability_of_laws
    from experiments.certify.certify import certified_rivers

    if config.leads:
        reason = "for a led figure this takes too long here; use hvf certify --mode lead"
        return (GainVerdict("field", Verdict("unknown", reason), None),)
    try:
        rivers, stable = certified_rivers(config), stability_of_laws(config, HandRange())
    except (ControllerError, SimError) as error:
        return (GainVerdict("field", Verdict("unknown", str(error)), None),)
    return tuple(
        GainVerdict(_LAW_NAMES.get(name, name.strip("_")), stable[name], passivity(river))
        for name, river in rivers.items()
    )
