"""What tuning is held against, and how all of them do with people who took no part in it."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.sampled_loop import SampledLoop
from controllers.certificates.loop.stability import critical_stiffness
from controllers.errors import ControllerError
from controllers.state import Array
from experiments.certify.certify import certified_rivers
from experiments.certify.kept_stability import Stability, kept_stability
from experiments.config.run_config import RunConfig
from experiments.tuning.panel import Panel, panel_runs
from experiments.tuning.search import Candidate, violation_of
from experiments.tuning.tune_config import TuneConfig

HALF = 0.5  # of the critical gain: J. G. Ziegler and N. B. Nichols, "Optimum settings for automatic controllers", 1942
RESAMPLES = 4999


@dataclass(frozen=True)
class Contender:
    """A configuration, judged on the held-back users.

    Attributes
    ----------
    name : str
        What made it.
    values : dict of str to float
        What it sets.
    config : RunConfig
        All of it, with nobody at the stylus.
    stability : Stability
        What is certain of it.
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
        """Over the users, shape (objectives,)."""
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
        What it chose.
    searched : mapping of str to Candidate
        By name, what others chose.
    panel : Panel
        That tries them.
    """
    values: dict[str, dict[str, float]] = {"tuned": tuned.values, "defaults": {}}
    values |= {name: candidate.values for name, candidate in searched.items() if candidate is not None}
    rule = half_critical(config)
    if rule is not None:
        values["half the critical gain"] = rule
    return [_judged(config, name, its, panel) for name, its in values.items()]


def half_critical(config: TuneConfig) -> dict[str, float] | None:
    """Ziegler and Nichols's proportional rule: half the gain at which the loop is on the verge, at the default damping.

    The verge is the certificate's, with the least favourable hand; the other numbers are the defaults. None where the
    stiffness is not tuned, or there is no certificate.
    """
    if "stiffness" not in config.space:
        return None
    try:
        river = certified_rivers(config.config({}))[""]
    except ControllerError:
        return None
    loops = [SampledLoop(river.still(hand), river.sampling) for hand in HandRange().hands()]
    return {"stiffness": HALF * min(float(critical_stiffness(loop, river.b_d).min()) for loop in loops)}


def _judged(config: TuneConfig, name: str, values: dict[str, float], panel: Panel) -> Contender:
    made = config.config(values)
    stability = kept_stability(made)
    if violation_of(config, stability) > 0.0 and stability.verdict == "refuted":
        never = np.full((config.held_back.number, len(config.objectives)), np.nan)
        return Contender(name, values, made, stability, never)
    runs = panel_runs(config, made, config.held_back)
    return Contender(name, values, made, stability, panel.objectives(config, runs, stability.margin))


def interval(differences: Array, seed: int) -> tuple[float, float]:
    """95 % BCa bootstrap interval of a mean of paired differences; NaN where they do not spread."""
    from scipy.stats import bootstrap

    if len(differences) < 3 or not np.all(np.isfinite(differences)) or np.ptp(differences) == 0.0:
        return float("nan"), float("nan")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a degenerate sample, whose interval is then NaN
        found = bootstrap((differences,), np.mean, n_resamples=RESAMPLES, rng=np.random.default_rng(seed))
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def wins(contender: Contender, tuned: Contender, directions: Sequence[str]) -> Array:
    """Differences of a contender from what was tuned, by user, positive where the tuned one is better."""
    signs = np.array([1.0 if direction == "minimize" else -1.0 for direction in directions])
    return signs * (contender.by_user - tuned.by_user)
