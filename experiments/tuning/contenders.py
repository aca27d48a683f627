"""Comparison of the tuned values with baselines, on held-back users who took no part in the tuning."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.stability import critical_stiffness
from controllers.errors import ControllerError
from experiments.certify.cached_stability import Stability, cached_stability
from experiments.certify.certify import certified_rivers
from experiments.config.run_config import RunConfig
from experiments.tuning.panel import Panel, panel_runs
from experiments.tuning.search import Candidate, violation_of
from experiments.tuning.tune_config import TuneConfig
from geometry.arrays import Array

GAIN_RATIO = 0.5  # share of the critical gain: Ziegler and Nichols, "Optimum settings for automatic controllers", 1942


@dataclass(frozen=True)
class Contender:
    """A configuration, evaluated on the held-back users.

    Attributes
    ----------
    name : str
        Method that made it.
    values : dict of str to float
        Values that it sets, by word of a run.
    config : RunConfig
        The whole configuration, without a person at the stylus.
    stability : Stability
        Its stability certificate.
    by_user : Array
        Objectives of each held-back user, shape (users, objectives).
    """

    name: str
    values: dict[str, float]
    config: RunConfig
    stability: Stability
    by_user: Array

    @property
    def means(self) -> Array:
        """Mean objectives over the users, shape (objectives,)."""
        return np.mean(self.by_user, axis=0)


def contenders(
    config: TuneConfig, tuned: Candidate, searched: Mapping[str, Candidate | None], panel: Panel
) -> list[Contender]:
    """The tuned values, the defaults, other searches of the same budget, and a rule of thumb, on the held-back users.

    Parameters
    ----------
    config : TuneConfig
        The tuning.
    tuned : Candidate
        The candidate chosen by the tuning.
    searched : mapping of str to Candidate
        The candidates chosen by other searches, by name.
    panel : Panel
        Runs the trials.
    """
    values: dict[str, dict[str, float]] = {"tuned": tuned.values, "defaults": {}}
    values |= {name: candidate.values for name, candidate in searched.items() if candidate is not None}
    rule = half_critical(config)
    if rule is not None:
        values["half the critical gain"] = rule
    return [_evaluate(config, name, own, panel) for name, own in values.items()]


def half_critical(config: TuneConfig) -> dict[str, float] | None:
    """Ziegler and Nichols's rule for proportional control: half the critical gain, at the default damping.

    The critical gain is the certificate's, for the least favourable hand; all other parameters have their defaults.
    None if the stiffness is not tuned, or there is no certificate.
    """
    if "stiffness" not in config.space:
        return None
    try:
        river = certified_rivers(config.config({}))[""]
    except ControllerError:
        return None
    loops = [river.loop(hand) for hand in HandRange().hands()]
    return {"stiffness": GAIN_RATIO * min(float(critical_stiffness(loop, river.b_d).min()) for loop in loops)}


def _evaluate(config: TuneConfig, name: str, values: dict[str, float], panel: Panel) -> Contender:
    candidate = config.config(values)
    stability = cached_stability(candidate)
    if violation_of(config, stability) > 0.0 and stability.verdict == "refuted":
        no_results = np.full((config.held_back.number, len(config.objectives)), np.nan)
        return Contender(name, values, candidate, stability, no_results)
    runs = panel_runs(config, candidate, config.held_back)
    return Contender(name, values, candidate, stability, panel.objectives(config, runs, stability.margin))
