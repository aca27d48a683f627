"""Runs a tuning: search, comparison with baselines, certificate and report."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from optuna.storages import BaseStorage
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from experiments.certify.certify import certify_into
from experiments.config.part import to_json
from experiments.config.paths import with_paths
from experiments.files.json_text import json_text
from experiments.trials.analysis.statistics import bootstrap_interval
from experiments.trials.design.study_config import StudyError, Where
from experiments.trials.execution.database import Database
from experiments.trials.execution.drive import compile_and_make_maps
from experiments.trials.execution.executors import executor
from experiments.tuning.contenders import Contender, contenders
from experiments.tuning.page import gains_figure, objectives_figure, tuning_page
from experiments.tuning.panel import Panel, panel_runs
from experiments.tuning.search import Candidate, best_candidate, distributions_of, search, signs_of, storage_of
from experiments.tuning.tune_config import MARGIN, TuneConfig, label_of
from geometry.whole_files import write_text

DATABASE, JOURNAL, CHOSEN, REPORT, SUMMARY = "tune.sqlite", "tune.journal", "chosen.json", "report.html", "summary.json"
CERTIFICATE = "certificate"
RANDOM = "random search"


@dataclass(frozen=True)
class Comparison:
    """A contender compared with the tuned values, on one objective and the held-back users.

    Attributes
    ----------
    contender, objective : str
        Name of the contender and of the objective.
    mean, tuned : float
        Means over the users, of the contender and of the tuned values.
    better_by, low, high : float
        By how much the tuned values are better, with the 95 % bootstrap interval over users.
    """

    contender: str
    objective: str
    mean: float
    tuned: float
    better_by: float
    low: float
    high: float


@dataclass(frozen=True)
class Tuned:
    """Result of a tuning.

    Attributes
    ----------
    folder : Path
        Folder of journal, database, report and the chosen configuration.
    values : dict of str to float
        The chosen values, by word of a run.
    candidates : tuple of Candidate
        All proposed candidates.
    comparisons : tuple of Comparison
        Comparisons with the other contenders, on the held-back users.
    importances : dict of str to dict
        Importance of each tuned parameter, by objective.
    sentences : tuple of str
        Main results, for a skimming reader.
    """

    folder: Path
    values: dict[str, float]
    candidates: tuple[Candidate, ...]
    comparisons: tuple[Comparison, ...]
    importances: dict[str, dict[str, float]]
    sentences: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join(self.sentences)

    def to_json(self) -> str:
        """The result without the folder, as JSON."""
        names = ("values", "sentences", "importances", "comparisons", "candidates")
        return json_text({name: getattr(self, name) for name in names})


def run_tuning(config: TuneConfig, out: Path, text: str = "", where: Where | None = None) -> Tuned:
    """Search, compare the chosen candidate with others, certify it, and write a report.

    Parameters
    ----------
    config : TuneConfig
        The tuning.
    out : Path
        Folder; if it holds this tuning, the tuning is continued.
    text : str
        Text of the tuning's file, as the report shows it.
    where : Where, optional
        Where trials run; by default on as many threads as there are processors.

    Raises
    ------
    HvfError, OSError
        If it contradicts itself, or cannot go on; completed trials are kept.
    """
    console, text = Console(stderr=True), text or to_json(config)
    identity = hashlib.sha256(to_json(replace(config, candidates=1, name="", storage="")).encode()).hexdigest()[:16]
    with Database(out / DATABASE, identity, config.name, text) as database:
        compile_and_make_maps(panel_runs(config, config.config({}), replace(config.users, number=1))[0], console)
        with executor(where or Where()) as pool:
            panel, storage = Panel(database, pool), storage_of(config.storage or out / JOURNAL)
            found = _run_search(config, storage, identity, panel, config.sampler, console)
            best = best_candidate(found, config.directions)
            if best is None:
                refused = sum(c.state == "refused" for c in found)
                raise StudyError(
                    f"tuning {config.name!r}: none of {len(found)} candidates is left: {refused} are not certified, of "
                    f"{len(found) - refused} a trial failed; expected another space, or allow_unknown = true"
                )
            others: dict[str, Candidate | None] = {}
            if config.sampler != "random":
                random_candidates = _run_search(config, storage, identity, panel, "random", console)
                others[RANDOM] = best_candidate(random_candidates, config.directions)
            with console.status("held-back users"):
                judged = contenders(config, best, others, panel)
    return _write_results(config, out, text, found, best, judged)


def _run_search(
    config: TuneConfig, storage: BaseStorage, identity: str, panel: Panel, sampler: str, console: Console
) -> list[Candidate]:
    columns = (TextColumn(f"{sampler} candidates"), BarColumn(), TextColumn("{task.completed} of {task.total}"))
    with Progress(*columns, TimeRemainingColumn(), console=console) as progress:
        bar = progress.add_task("", total=config.candidates)
        return search(config, storage, identity, panel, sampler, lambda n: progress.update(bar, completed=n))


def _write_results(
    config: TuneConfig, out: Path, text: str, found: Sequence[Candidate], best: Candidate, judged: Sequence[Contender]
) -> Tuned:
    tuned = judged[0]
    write_text(out / CHOSEN, to_json(with_paths(tuned.config, os.path.abspath)))
    certificate = certify_into(tuned.config, out / CERTIFICATE)
    comparisons = compared(config, judged)
    importances = importances_of(config, found)
    sentences = _sentences(config, best, found, tuned, comparisons)
    others = {c.name: _gains(c) for c in judged[1:]}
    plots = [objectives_figure(config, found, best), gains_figure(config, found, best, others)]
    verdicts = {name: verdict.reason for name, verdict in certificate.verdicts.items()}
    page = tuning_page(config, text, sentences, judged, comparisons, importances, plots, verdicts)
    write_text(out / REPORT, page)
    result = Tuned(out, best.values, tuple(found), tuple(comparisons), importances, sentences)
    write_text(out / SUMMARY, result.to_json() + "\n")
    return result


def _gains(contender: Contender) -> dict[str, float]:
    mode = cast(Any, contender.config.mode)
    return {name: float(getattr(mode, name, np.nan) or np.nan) for name in ("stiffness", "damping")}


def compared(config: TuneConfig, judged: Sequence[Contender]) -> list[Comparison]:
    """Comparisons of every other contender with the first one, which is the tuned one, on every objective."""
    comparisons: list[Comparison] = []
    for contender in judged[1:]:
        gains = signs_of(config.directions) * (contender.by_user - judged[0].by_user)  # positive where tuned is better
        for k, objective in enumerate(config.objectives):
            low, high = bootstrap_interval((gains[:, k],), np.random.default_rng(config.seed))
            means = float(contender.means[k]), float(judged[0].means[k])
            comparisons.append(Comparison(contender.name, objective, *means, float(np.mean(gains[:, k])), low, high))
    return comparisons


def importances_of(config: TuneConfig, candidates: Sequence[Candidate]) -> dict[str, dict[str, float]]:
    """Hyperparameter importances of the tuned parameters, by objective (optuna's PED-ANOVA)."""
    import optuna

    tried = [c for c in candidates if c.objectives is not None]
    if len(tried) < 4 or len(config.space) < 2:
        return {}
    shares: dict[str, dict[str, float]] = {}
    space = distributions_of(config)
    for k, objective in enumerate(config.objectives):
        study = optuna.create_study(direction=config.directions[k])
        for c in tried:
            value = cast(tuple[float, ...], c.objectives)[k]
            study.add_trial(optuna.trial.create_trial(params=c.values, distributions=space, value=value))
        evaluator = optuna.importance.PedAnovaImportanceEvaluator()
        importances = optuna.importance.get_param_importances(study, evaluator=evaluator)
        shares[objective] = {word: float(share) for word, share in importances.items()}
    return shares


def _sentences(
    config: TuneConfig, best: Candidate, found: Sequence[Candidate], tuned: Contender, comparisons: Sequence[Comparison]
) -> tuple[str, ...]:
    counts = {state: sum(c.state == state for c in found) for state in ("tried", "given up", "refused")}
    values = ", ".join(f"{word} {value:.4g}" for word, value in best.values.items())
    margin = "" if tuned.stability.margin is None else f", with a margin of {tuned.stability.margin:.3g} in k_r"
    return (
        f"Chosen: {values}; its stability is {tuned.stability.verdict}{margin}.",
        f"{counts['tried']} candidates were tried on {config.users.number} users, {counts['given up']} stopped "
        f"early, {counts['refused']} refused untried by the certificate.",
        *(_sentence(config, comparison) for comparison in comparisons),
    )


def _sentence(config: TuneConfig, c: Comparison) -> str:
    unit = label_of(c.objective)
    if not (np.isfinite(c.mean) and np.isfinite(c.tuned)):
        failed = "what was chosen" if np.isinf(c.tuned) else "it" if np.isinf(c.mean) else ""
        why = f"a trial of {failed} failed" if failed else "that is refuted by the certificate, and was not tried"
        return f"Against {c.contender}, {unit}: {why}."
    if c.objective == MARGIN:
        return f"Against {c.contender}, {unit}: {c.tuned:.3g} for {c.mean:.3g}."
    if c.better_by == 0.0:
        return f"Against {c.contender}, {unit}: the same, {c.tuned:.3g}."
    word = "better" if c.better_by > 0.0 else "worse"
    shown = "" if c.low > 0.0 or c.high < 0.0 else ", so no difference is shown"
    gained = f"95 % interval of what is gained {c.low:.3g} to {c.high:.3g}{shown}"
    if np.isnan(c.low):
        gained = "no difference is shown: an interval takes three users or more, who do not gain the same"
    return (
        f"Against {c.contender}, on {config.held_back.number} held-back users, {unit}: {c.tuned:.3g} for {c.mean:.3g}, "
        f"{word} by {abs(c.better_by):.3g} ({gained})."
    )
