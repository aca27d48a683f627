"""Configuration of a study, read from a TOML file or given in Python."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import Field

from controllers.errors import ParameterError
from experiments.config.part import above, from_dict, part, whole_number
from experiments.config.paths import with_paths_of_options
from sim.errors import SimError


class StudyError(SimError):
    """A study that cannot be planned, run, continued or read; the message names it and says what to do."""


MAX_TRIALS = 1_000_000
"""Maximum number of trials of a study or a tuning: the number of people in the largest population."""
MAX_TRIAL_DURATION = 86_400.0
"""Maximum duration of a trial: a day [s]."""
Words = dict[str, Any]
"""Parameters of a run by word, as `experiments.config.options.run_config` takes them."""


@part
class Users:
    """Participants of a study.

    Parameters
    ----------
    number : int
        Number of simulated people.
    seed : int
        Seed of the population from which they are drawn.
    does : str
        Their task, as in ``hvf run --user``, unless a factor sets the word "user"; in the mode "lead" they lead.
    """

    number: int = whole_number(1, default=12)
    seed: int = whole_number(0, default=1)
    does: str = "trace"


@part
class StudyConfig:
    """A study: who does what under which conditions, how often, and what is measured.

    Parameters
    ----------
    name : str
        Title of the report.
    factors : mapping
        Levels by name of the factor; each level has a name and the words of a run that it sets.
    question : str
        Question that the study is to answer.
    run : mapping
        Words of a run that all conditions share.
    between : tuple of str
        Between-subject factors, of which a user meets one level only; all others are within-subject.
    users : Users
        The participants.
    repetitions : int
        Number of repetitions of every condition by every user.
    order : {"latin-square", "fixed"}
        Order of a user's conditions: counterbalanced by a balanced Latin square, or as written.
    measures : tuple of str
        Measures; by default all that exist for the figure (see `experiments.trials.trial.measures`).
    ease, cost : str
        The two measures with which the report begins: how hard the task was, and what that costs.
    seconds : float
        Simulated time of a trial [s].
    seed : int
        Seed of everything random in the trials except the choice of users.
    recordings : str
        Folder, or URL supported by fsspec, for a recording of every trial; none by default.
    """

    name: str
    factors: dict[str, dict[str, Words]]
    question: str = ""
    run: Words = Field(default_factory=dict)
    between: tuple[str, ...] = ()
    users: Users = Users()
    repetitions: int = whole_number(1, default=1)
    order: Literal["latin-square", "fixed"] = "latin-square"
    measures: tuple[str, ...] = ()
    ease: str = "tracking_error"
    cost: str = "expressiveness"
    seconds: float = above(0.0, default=8.0, unit="s", most=MAX_TRIAL_DURATION)
    seed: int = whole_number(0, default=1)
    recordings: str = ""

    def with_users(self, number: int | None, seed: int | None) -> "StudyConfig":
        """The same study with another number of users, or another seed of trials and population."""
        users = self.users if number is None else replace(self.users, number=number)
        return replace(self, users=users) if seed is None else replace(self, users=replace(users, seed=seed), seed=seed)

    def with_paths(self, change: Callable[[str], str]) -> "StudyConfig":
        """The same study in whose options a function has changed the paths."""
        factors = {
            name: {level: with_paths_of_options(words, change) for level, words in levels.items()}
            for name, levels in self.factors.items()
        }
        return replace(self, run=with_paths_of_options(self.run, change), factors=factors)


def parse_study(values: Mapping[str, object], where: str) -> StudyConfig:
    """A study from the entries of its file; a factor may be a list of values of the word after which it is named.

    Raises
    ------
    ParameterError
        If there is an unknown entry, or a required one is missing.
    StudyError
        If a factor is neither a list nor a table, or has a level twice.
    """
    given = dict(values)
    factors = given.get("factors", {})
    if isinstance(factors, Mapping):
        factors = cast(Mapping[str, object], factors)
        given["factors"] = {name: _parse_levels(name, levels) for name, levels in factors.items()}
    return from_dict(StudyConfig, given, where)


def _parse_levels(name: str, levels: object) -> object:
    if isinstance(levels, Mapping):
        return cast(object, levels)
    if not isinstance(levels, list):
        raise StudyError(f"factor {name!r} is {levels!r}; expected a list of values, or a table of levels")
    values = cast(list[object], levels)
    names = [" ".join(map(str, v)) if isinstance(v, list) else str(v) for v in values]  # pyright: ignore
    if len(set(names)) < len(names):
        duplicate = next(one for one in names if names.count(one) > 1)
        raise StudyError(f"factor {name!r} has level {duplicate} twice; expected each value once")
    return {level: {name: value} for level, value in zip(names, values, strict=True)}


def check_trials(where: str, trials: int, made_of: str) -> None:
    """Refuse more than `MAX_TRIALS` trials; `made_of` lists the factors of their number for the message.

    Raises
    ------
    StudyError
        If there are more.
    """
    if trials > MAX_TRIALS:
        raise StudyError(f"{where}: {made_of} are too many; expected at most {MAX_TRIALS} trials")


def read_toml(path: Path, what: str) -> dict[str, object]:
    """Content of a TOML file.

    Raises
    ------
    StudyError
        If it cannot be read.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise StudyError(f"{path}: cannot be read ({error.strerror}); expected the TOML file of {what}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {error}; expected the TOML file of {what}") from None


@part
class Where:
    """Where trials run: one of three."""

    threads: Annotated[int | None, whole_number(1)] = None
    """Trials at a time in this process; by default as many as there are processors."""
    workers: Annotated[int | None, whole_number(1)] = None
    """Run them in so many processes of a local Dask cluster instead."""
    cluster: str | None = None
    """Run them on the workers of this Dask scheduler instead, such as tcp://host:8786."""

    def __post_init__(self) -> None:
        given = {"--threads": self.threads, "--workers": self.workers, "--cluster": self.cluster}
        chosen = [name for name, value in given.items() if value is not None]
        if len(chosen) > 1:
            raise ParameterError(f"{' and '.join(chosen)} contradict each other; expected one of them")
