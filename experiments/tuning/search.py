"""The search of a tuning: candidates are proposed, certified and only then tried on the panel; each step is stored."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import optuna
from optuna.distributions import FloatDistribution
from optuna.storages.journal import JournalFileBackend
from optuna.trial import TrialState

from experiments.certify.cached_stability import Stability, cached_stability
from experiments.trials.design.plan import code_hash
from experiments.trials.design.study_config import StudyError
from experiments.tuning.panel import Panel, panel_runs
from experiments.tuning.tune_config import TuneConfig
from geometry.arrays import Array


def storage_of(where: str | Path) -> optuna.storages.BaseStorage:
    """Optuna's storage in a file or at a URL.

    Parameters
    ----------
    where : str or Path
        File of a journal, or a URL such as ``sqlite:///tune.db`` or ``postgresql://user@host/base``.

    Raises
    ------
    StudyError
        If the file cannot be written or is something else, or the database cannot be reached.
    """
    if "://" not in str(where):
        try:
            with open(where, "a+b") as file:
                file.seek(0)
                first_line = file.readline()
            if first_line and "op_code" not in json.loads(first_line):  # Optuna takes any single line for unfinished
                raise ValueError
            return optuna.storages.JournalStorage(JournalFileBackend(str(where)))
        except OSError as error:
            raise StudyError(f"{where}: {error.strerror}; expected a file that can be written") from None
        except (ValueError, TypeError, KeyError):
            raise StudyError(
                f"{where}: is no journal of a search, and is left as it is; expected a new file, or that of a search"
            ) from None
    try:
        return optuna.storages.RDBStorage(str(where))
    except Exception as error:  # from SQLAlchemy, a driver that is not installed, or a server that does not answer
        message = str(error).strip().splitlines()[0]
        raise StudyError(
            f"{where}: no storage for a search ({message}); expected a URL of SQLAlchemy such as sqlite:///tune.db"
        ) from None


# maximum of proposals per simulated candidate; if more are needed, hardly any point is certified
MAX_PROPOSALS_RATIO = 30
RANDOM_STARTUP_COUNT = 10  # candidates drawn at random before a sampler begins to learn from results


def sampler_of(name: str, seed: int, number: int) -> optuna.samplers.BaseSampler:
    """The sampler for a candidate by its number; an interrupted search continues as if it had not been interrupted.

    A sampler's state consists of the study's results, which are stored, and its seed, which depends on the number.
    """
    candidate_seed = int(np.random.SeedSequence((seed, *name.encode(), number)).generate_state(1, np.uint32)[0])
    makers: dict[str, Callable[[], optuna.samplers.BaseSampler]] = {
        "tpe": lambda: optuna.samplers.TPESampler(
            seed=candidate_seed, multivariate=True, n_startup_trials=RANDOM_STARTUP_COUNT
        ),
        "cma-es": lambda: optuna.samplers.CmaEsSampler(seed=candidate_seed, n_startup_trials=RANDOM_STARTUP_COUNT),
        "nsga-ii": lambda: optuna.samplers.NSGAIISampler(seed=candidate_seed, population_size=RANDOM_STARTUP_COUNT),
        "random": lambda: optuna.samplers.RandomSampler(seed=candidate_seed),
    }
    return makers[name]()


def distributions_of(config: TuneConfig) -> dict[str, optuna.distributions.BaseDistribution]:
    """Optuna's distributions of the tuned parameters."""
    return {word: FloatDistribution(span.low, span.high, log=span.log) for word, span in config.space.items()}


_FINISHED = (TrialState.COMPLETE, TrialState.PRUNED)


class Candidate(NamedTuple):
    """A proposed candidate.

    Attributes
    ----------
    values : dict of str to float
        Values by word of a run.
    objectives : tuple of float or None
        Objectives in the order of the tuning; None if the candidate was refused or given up.
    verdict : str
        Verdict of the stability certificate.
    margin : float or None
        Margin of the stability certificate.
    state : {"tried", "given up", "refused"}
        Whether it was tried on the panel, given up, or refused by the certificate.
    """

    values: dict[str, float]
    objectives: tuple[float, ...] | None
    verdict: str
    margin: float | None
    state: str


def search(
    config: TuneConfig, storage: optuna.storages.BaseStorage, identity: str, panel: Panel, sampler: str,
    progress: Callable[[int], None],
) -> list[Candidate]:  # fmt: skip
    """Search until enough candidates have been simulated, continuing from those that this code has tried before.

    Parameters
    ----------
    config : TuneConfig
        The tuning.
    storage : optuna.storages.BaseStorage
        Storage of the search; see `storage_of`.
    identity : str
        Hash of the tuning, which names it in the storage together with the hash of the code.
    panel : Panel
        Tries the candidates.
    sampler : str
        Sampler that proposes candidates; see `TuneConfig`.
    progress : callable
        Called with the number of simulated candidates.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(
        storage=storage, study_name=f"{identity}-{code_hash(__name__)}-{sampler}", load_if_exists=True,
        directions=list(config.directions),
        pruner=optuna.pruners.MedianPruner(n_startup_trials=RANDOM_STARTUP_COUNT, n_warmup_steps=1),
    )  # fmt: skip
    space = distributions_of(config)
    for interrupted in study.get_trials(states=(TrialState.RUNNING,)):
        study.tell(interrupted.number, state=TrialState.FAIL)  # it is proposed again
    while True:
        proposed = candidates_of(study)
        simulated = sum(candidate.state != "refused" for candidate in proposed)
        progress(simulated)
        if simulated >= config.candidates or len(proposed) >= MAX_PROPOSALS_RATIO * config.candidates:
            return proposed
        study.sampler = sampler_of(sampler, config.seed, len(proposed))
        _try_candidate(config, study, study.ask(space), panel)


def _try_candidate(config: TuneConfig, study: optuna.Study, trial: optuna.Trial, panel: Panel) -> None:
    candidate = config.config(trial.params)
    stability = cached_stability(candidate)
    violation = violation_of(config, stability)
    trial.set_user_attr("verdict", stability.verdict)
    trial.set_user_attr("margin", stability.margin)
    trial.set_user_attr("violation", violation)
    trial.set_constraint("certificate", violation)
    if violation > 0.0:
        study.tell(trial, state=TrialState.PRUNED)
        return
    values = _panel_means(config, trial, panel, stability)
    if values is None or not np.all(np.isfinite(values)):
        study.tell(trial, state=TrialState.PRUNED)
    else:
        study.tell(trial, values)


def violation_of(config: TuneConfig, stability: Stability) -> float:
    """By how much a candidate violates the constraint of the certificate; 0 if it may be tried."""
    if stability.verdict == "refuted":
        return 1.0 - min(0.0, stability.margin or 0.0)
    if stability.verdict == "unknown" and not config.allow_unknown:
        return 1.0
    return 0.0 if stability.margin is None else max(0.0, config.least_margin - stability.margin)


def _panel_means(config: TuneConfig, trial: optuna.Trial, panel: Panel, stability: Stability) -> list[float] | None:
    """Mean objectives over the panel; None if the candidate is given up after part of the panel."""
    by_user = panel_runs(config, config.config(trial.params), config.users)
    third = max(1, len(by_user) // 3)
    parts = [by_user[:third], by_user[third:]] if config.prune and len(config.objectives) == 1 else [by_user]
    values = np.empty((0, len(config.objectives)))
    for step, part in enumerate(parts):
        values = np.vstack((values, panel.objectives(config, part, stability.margin)))
        if step + 1 < len(parts):
            trial.report(float(np.mean(values)), step + 1)
            if trial.should_prune():
                return None
    return [float(mean) for mean in np.mean(values, axis=0)]


def candidates_of(study: optuna.Study) -> list[Candidate]:
    """All proposed candidates, in the order of their proposal."""
    candidates: list[Candidate] = []
    for t in study.get_trials(deepcopy=False, states=_FINISHED):
        attributes: dict[str, Any] = t.user_attrs
        complete = t.state == TrialState.COMPLETE  # a candidate that is given up has values for part of the panel only
        state = "refused" if attributes["violation"] > 0.0 else "tried" if complete else "given up"
        values = tuple(t.values) if complete else None
        candidates.append(Candidate(dict(t.params), values, attributes["verdict"], attributes["margin"], state))
    return candidates


def signs_of(directions: Sequence[str]) -> Array:
    """1 for each objective to be minimised, −1 for each to be maximised: its factor as a cost."""
    return np.array([1.0 if direction == "minimize" else -1.0 for direction in directions])


def pareto_front(candidates: Sequence[Candidate], directions: Sequence[str]) -> list[Candidate]:
    """The Pareto front: candidates that no other one dominates."""
    tried = [candidate for candidate in candidates if candidate.objectives is not None]
    signs = signs_of(directions)
    costs = np.array([signs * np.array(c.objectives) for c in tried]).reshape(len(tried), len(signs))
    return [
        c for c, cost in zip(tried, costs, strict=True)
        if not np.any(np.all(costs <= cost, axis=1) & np.any(costs < cost, axis=1))
    ]  # fmt: skip


def best_candidate(candidates: Sequence[Candidate], directions: Sequence[str]) -> Candidate | None:
    """The best candidate for one objective; for several, the one of the front `nearest_to_ideal`; None if none."""
    signs, tried = signs_of(directions), [c.objectives for c in candidates if c.objectives is not None]
    if not tried:
        return None
    front = pareto_front(candidates, directions)
    return front[nearest_to_ideal(signs * np.array([c.objectives for c in front]), signs * np.array(tried))]


def nearest_to_ideal(front: Array, tried: Array) -> int:
    """Index of the row of a Pareto front nearest to the ideal point, which has the least of each cost.

    Costs are scaled to their range over all candidates that were tried: by the range on the front, the two rows of a
    front of two would always be equally near.

    Parameters
    ----------
    front, tried : Array
        Costs of the front and of all candidates, shapes (n, costs) and (m, costs).
    """
    span = np.ptp(tried, axis=0)
    return int(np.argmin(np.linalg.norm((front - tried.min(axis=0)) / np.where(span > 0.0, span, 1.0), axis=1)))
