"""A study as it is written: one TOML file, or the same in Python."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, cast

from pydantic import Field

from experiments.config.part import above, from_dict, part, whole
from experiments.trials.errors import StudyError

Words = dict[str, Any]
"""A run in words, as `experiments.config.words.run_config` takes them."""


@part
class Users:
    """Who takes part.

    Parameters
    ----------
    number : int
        How many simulated people.
    seed : int
        Of the population that they are drawn from.
    does : str
        What they mean to do, as ``hvf run --user`` has it, unless a factor sets the word "user"; they lead in the mode
        "lead".
    """

    number: int = whole(1, default=12)
    seed: int = whole(0, default=1)
    does: str = "trace"


@part
class StudyConfig:
    """A study: who does what under which conditions, how often, and what is measured.

    Parameters
    ----------
    name : str
        What heads the report.
    factors : mapping
        By name of a factor its levels, by name of a level what it sets, in the words of a run.
    question : str
        What it is to answer.
    run : mapping
        What all conditions share, in the words of a run.
    between : tuple of str
        Factors of which a user meets one level only; of the others every user meets every level.
    users : Users
        Who takes part.
    repetitions : int
        Of every condition by every user.
    order : {"latin-square", "fixed"}
        Of the conditions of a user: each as often in every place and after every other one, or as they are written.
    measures : tuple of str
        By default all that the figure has (see `experiments.trials.measures`).
    ease, cost : str
        The two measures that the report begins with: how hard the task was, and what that costs.
    seconds : float
        Simulated time of a trial [s].
    seed : int
        Of all that is random in the trials beside who the users are.
    recordings : str
        Folder, or URL that fsspec knows, that keeps a recording of every trial; none by default.
    """

    name: str
    factors: dict[str, dict[str, Words]]
    question: str = ""
    run: Words = Field(default_factory=dict)
    between: tuple[str, ...] = ()
    users: Users = Users()
    repetitions: int = whole(1, default=1)
    order: Literal["latin-square", "fixed"] = "latin-square"
    measures: tuple[str, ...] = ()
    ease: str = "tracking_error"
    cost: str = "expressiveness"
    seconds: float = above(0.0, default=8.0, unit="s")
    seed: int = whole(0, default=1)
    recordings: str = ""

    def with_users(self, number: int | None, seed: int | None) -> "StudyConfig":
        """The same study with another number of users, or another seed of trials and population."""
        users = self.users if number is None else replace(self.users, number=number)
        return replace(self, users=users) if seed is None else replace(self, users=replace(users, seed=seed), seed=seed)


def study_from(values: Mapping[str, object], where: str) -> StudyConfig:
    """A study from what its file says; a factor may be written as a list of values of the word that it is named after.

    Raises
    ------
    ParameterError
        If it says something that a study has not, or leaves out what it must have.
    StudyError
        If a factor has no levels, or one of them twice.
    """
    given = dict(values)
    factors = given.get("factors", {})
    if isinstance(factors, Mapping):
        factors = cast(Mapping[str, object], factors)
        given["factors"] = {name: _levels(name, levels) for name, levels in factors.items()}
    return from_dict(StudyConfig, given, where)


def _levels(name: str, levels: object) -> object:
    if isinstance(levels, Mapping):
        return cast(object, levels)
    if not isinstance(levels, list):
        raise StudyError(f"factor {name!r} is {levels!r}; expected a list of values, or a table of levels")
    values = cast(list[object], levels)
    names = [" ".join(map(str, v)) if isinstance(v, list) else str(v) for v in values]  # pyright: ignore
    if len(set(names)) < len(names):
        twice = next(one for one in names if names.count(one) > 1)
        raise StudyError(f"factor {name!r} has level {twice} twice; expected each value once")
    return {level: {name: value} for level, value in zip(names, values, strict=True)}


def read_toml(path: Path, what: str) -> dict[str, object]:
    """What a TOML file says.

    Raises
    ------
    StudyError
        If it cannot be read.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StudyError(f"{path}: cannot be read ({error.strerror}); expected the TOML file of {what}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {error}; expected the TOML file of {what}") from None
