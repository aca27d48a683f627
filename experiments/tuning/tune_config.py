"""Configuration of a tuning, read from a TOML file."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast

from pydantic import Field

from controllers.errors import ParameterError
from experiments.config.keywords import to_keywords
from experiments.config.options import run_config
from experiments.config.part import above, at_least, from_dict, part, whole_number
from experiments.config.paths import relative_to, with_paths_of_options
from experiments.config.run_config import RunConfig
from experiments.trials.design.study_config import MAX_TRIAL_DURATION, StudyError, Users, Words, check_trials, read_toml
from experiments.trials.trial.measures import CONDITION_MEASURES, MEASURES, measures_of
from sim.users.person.population import population

MARGIN = "margin"
"""Objective that is not a measure of trials: the certificate's margin (critical k_r)/k_r − 1, to be maximised."""

Sampler = Literal["tpe", "cma-es", "nsga-ii", "random"]
"""Search methods of Optuna; `experiments.tuning.search.sampler_of` makes them."""


@part
class Range:
    """Range of a parameter.

    Parameters
    ----------
    low, high : float
        Bounds, inclusive.
    log : bool
        Whether it is sampled on a logarithmic scale.
    """

    low: float = at_least(0.0)
    high: float = at_least(0.0)
    log: bool = False


@part
class TuneConfig:
    """A tuning: search space, objectives, users and budget.

    Parameters
    ----------
    name : str
        Title of the report.
    space : mapping
        Range of each tuned parameter, by word of a run.
    objectives : tuple of str
        Measures of trials (see `experiments.trials.trial.measures`), each the mean over the panel, or "margin"; for
        more than one a Pareto front is sought.
    run : mapping
        Words of a run that all candidates share.
    users : Users
        The panel.
    held_back : Users
        Users on whom the result is evaluated, of another seed than the panel.
    tasks : tuple of str
        Tasks of every user in turn, as in ``hvf run --user``, for objectives that no single task has: tracing, for
        example, has no expressiveness. By default the tasks of `users` and `held_back`.
    repetitions : int
        Trials of a candidate with every user and task.
    seconds : float
        Simulated time of a trial [s].
    candidates : int
        Number of candidates to simulate.
    sampler : Sampler
        Sampler that proposes them.
    prune : bool
        Give up a candidate that is worse than the median after part of the panel; with one objective only.
    least_margin : float
        Margin of the stability certificate below which a candidate is not tried.
    allow_unknown : bool
        Also try candidates whose stability is unknown; refuted ones are never tried.
    seed : int
        Seed of the search and of the trials.
    storage : str
        URL of a database for SQLAlchemy, such as ``sqlite:///tune.db``, or file of a journal, in which the search is
        stored; by default a journal in the folder.
    """

    name: str
    space: dict[str, Range]
    objectives: tuple[str, ...] = ("tracking_error",)
    run: Words = Field(default_factory=dict)
    users: Users = Users(number=6, seed=1)
    held_back: Users = Users(number=12, seed=2)
    tasks: tuple[str, ...] = ()
    repetitions: int = whole_number(1, default=1)
    seconds: float = above(0.0, default=6.0, unit="s", most=MAX_TRIAL_DURATION)
    candidates: int = whole_number(1, default=40)
    sampler: Sampler = "tpe"
    prune: bool = True
    least_margin: float = at_least(0.0, default=0.0)
    allow_unknown: bool = False
    seed: int = whole_number(0, default=1)
    storage: str = ""

    def __post_init__(self) -> None:
        """Refuse more trials than a study may have; this also checks a number of candidates that is set later.

        Raises
        ------
        StudyError
            If there are too many.
        """
        tasks = max(1, len(self.tasks))
        for users, count, label in ((self.users, self.candidates, "candidates"), (self.held_back, 1, "result")):
            sizes = f"{count} {label}, {users.number} users, {tasks} tasks, {self.repetitions} repetitions"
            check_trials(f"tuning {self.name!r}", count * users.number * tasks * self.repetitions, sizes)

    @property
    def directions(self) -> tuple[Literal["minimize", "maximize"], ...]:
        """Directions of the objectives."""
        return tuple("maximize" if more_is_better(name) else "minimize" for name in self.objectives)

    def config(self, values: Mapping[str, float], does: str | None = None) -> RunConfig:
        """The run of a candidate, without a person at the stylus or, given a task, with the panel's first user.

        Raises
        ------
        StudyError
            If a word is unknown or meaningless with the others, or a number is out of its interval.
        """
        words: Words = self.run | dict(values) | {"seconds": self.seconds}
        if does is not None:
            words |= {"user": does, "person": population(1, self.users.seed)[0]}
        try:
            return run_config(**words)
        except ParameterError as error:
            raise StudyError(f"tuning {self.name!r}: {to_keywords(str(error))}") from None


def more_is_better(objective: str) -> bool:
    """Whether an objective is to be maximised."""
    return objective == MARGIN or MEASURES[objective].better == "more"


def label_of(objective: str) -> str:
    """Name and unit of an objective, for display."""
    return "margin of stability, (critical k_r)/k_r − 1" if objective == MARGIN else MEASURES[objective].label


def read_tuning(path: Path) -> TuneConfig:
    """The tuning in a TOML file.

    Raises
    ------
    StudyError, ParameterError
        If it cannot be read, or contradicts itself.
    """
    config = from_dict(TuneConfig, cast(Mapping[str, Any], read_toml(path, "a tuning")), str(path))
    config = replace(config, run=with_paths_of_options(config.run, relative_to(path.parent)))
    check_tuning(config)
    return config


def check_tuning(config: TuneConfig) -> None:
    """Refuse a tuning that contradicts itself.

    Raises
    ------
    StudyError, ParameterError
        If it contradicts itself.
    """
    where = f"tuning {config.name!r}"
    _check_space(config, where)
    _check_objectives(config, where)
    if config.users.seed == config.held_back.seed:
        raise StudyError(
            f"{where}: panel and held-back users are of the same seed {config.users.seed}; expected another in "
            f"[held_back], such as seed = {config.users.seed + 1}"
        )
    if config.sampler == "cma-es" and (len(config.objectives) > 1 or len(config.space) < 2):
        raise StudyError(f"{where}: CMA-ES needs one objective and two numbers or more; expected sampler = 'tpe'")
    for does in config.tasks or (config.users.does, config.held_back.does):
        config.config({}, does)


def _check_space(config: TuneConfig, where: str) -> None:
    if not config.space:
        raise StudyError(f"{where} has an empty space; expected an option of a run with its low and high")
    for word, span in config.space.items():
        if not span.low < span.high or (span.log and span.low <= 0.0):
            raise StudyError(
                f"{where}: {word} is from {span.low:g} to {span.high:g}; expected low < high, and above 0 with log"
            )
        if word in ("seed", "seconds"):
            raise StudyError(f"{where}: {word!r} is not a number to tune; expected one of field, map or figure")
    # Candidates lie anywhere between the bounds, so parameters that must be whole numbers are refused here.
    config.config({word: span.low + (span.high - span.low) / math.pi for word, span in config.space.items()})


def _check_objectives(config: TuneConfig, where: str) -> None:
    trial_measures = [name for name in MEASURES if name not in CONDITION_MEASURES]
    for name in config.objectives:
        if name != MARGIN and name not in trial_measures:
            raise StudyError(f"{where}: no objective {name!r}; there are {', '.join([*trial_measures, MARGIN])}")
    if not config.objectives or set(config.objectives) == {MARGIN}:
        raise StudyError(f"{where} has no measure among its objectives; expected one, such as tracking_error")
    if len(set(config.objectives)) < len(config.objectives):
        raise StudyError(f"{where}: an objective appears twice; expected {', '.join(dict.fromkeys(config.objectives))}")
    for end in ("low", "high"):
        candidate = config.config({word: getattr(span, end) for word, span in config.space.items()})
        missing = [n for n in config.objectives if n != MARGIN and n not in measures_of(candidate.figure.kind)]
        if missing:
            raise StudyError(f"{where}: {missing[0]!r} needs a figure that is {MEASURES[missing[0]].figure}")
