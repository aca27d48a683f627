"""Experimental design of a study: its conditions, their assignment to users, and their counterbalanced order."""

import itertools
import math
from collections.abc import Iterable
from typing import NamedTuple

from experiments.trials.design.study_config import StudyConfig, StudyError, Words, check_trials
from experiments.trials.trial.measures import MEASURES

_COLUMNS = ("key", "user", "repetition", "position", "seed", "state", "reason", *MEASURES)  # columns of the table


class Condition(NamedTuple):
    """Levels of all factors, by name of the factor, and the parameters of a run that they set."""

    levels: dict[str, str]
    words: Words


class DesignTrial(NamedTuple):
    """A trial of the design: a user in a condition.

    Attributes
    ----------
    user, repetition, position : int
        Number of the user, of the repetition of the condition, and of the trial in the user's sequence.
    number : int
        Index of the condition among all `conditions`.
    condition : Condition
        The condition.
    """

    user: int
    repetition: int
    position: int
    number: int
    condition: Condition


def conditions(study: StudyConfig) -> tuple[Condition, ...]:
    """All combinations of levels; the level of the last factor changes fastest.

    Raises
    ------
    StudyError
        If the design contradicts itself.
    """
    _check_design(study)
    names = list(study.factors)
    combinations: list[Condition] = []
    for chosen in itertools.product(*study.factors.values()):
        levels = dict(zip(names, chosen, strict=True))
        words: Words = {}
        for name, level in levels.items():
            words |= study.factors[name][level]
        combinations.append(Condition(levels, words))
    return tuple(combinations)


def design_trials(study: StudyConfig) -> tuple[DesignTrial, ...]:
    """Every trial of a study, by user and then in the order of time.

    Users are assigned in turn to the groups of the between-subject factors. Within a group, the users take the rows of
    a balanced Latin square in turn, or all of them the fixed order.

    Raises
    ------
    StudyError
        If the design contradicts itself.
    """
    groups: dict[tuple[str, ...], list[tuple[int, Condition]]] = {}
    for number, condition in enumerate(conditions(study)):
        group = tuple(condition.levels[name] for name in study.between)
        groups.setdefault(group, []).append((number, condition))
    arms = list(groups.values())
    if len(arms) > study.users.number:
        raise StudyError(
            f"study {study.name!r}: {len(arms)} groups between users and {study.users.number} users; expected a user "
            f"or more for each, or fewer factors in between"
        )
    trials: list[DesignTrial] = []
    for user in range(study.users.number):
        members = arms[user % len(arms)]
        rows = balanced_latin_square(len(members)) if study.order == "latin-square" else (tuple(range(len(members))),)
        row = rows[user // len(arms) % len(rows)]
        for repetition, (place, k) in itertools.product(range(study.repetitions), enumerate(row)):
            number, condition = members[k]
            trials.append(DesignTrial(user, repetition, repetition * len(row) + place, number, condition))
    return tuple(trials)


def balanced_latin_square(n: int) -> tuple[tuple[int, ...], ...]:
    """Orders of n conditions in which each is in every position, and follows every other one, equally often.

    A Latin square for even n, two of them for odd n (E. J. Williams, "Experimental designs balanced for the estimation
    of residual effects of treatments", *Australian Journal of Scientific Research* A 2, 1949): the first row is 0, 1,
    n−1, 2, n−2, …, each further row adds one modulo n, and for odd n the same rows are added in reverse.
    """
    first = [(k + 1) // 2 if k % 2 else (n - k // 2) % n for k in range(n)]
    rows = [tuple((k + shift) % n for k in first) for shift in range(n)]
    return tuple(rows if n % 2 == 0 else rows + [row[::-1] for row in rows])


def _check_design(study: StudyConfig) -> None:
    where = f"study {study.name!r}"
    if not study.factors:
        raise StudyError(f"{where} has no factors; expected one or more, such as stiffness = [100, 300]")
    for name, levels in study.factors.items():
        if name in _COLUMNS:
            raise StudyError(
                f"{where}: factor {name!r} has the name of another column of the table; expected another one, with "
                "levels that say what they set"
            )
        if len(levels) < 2:
            present = f"one level, {next(iter(levels))!r}" if levels else "no levels"
            raise StudyError(f"{where}: factor {name!r} has {present}; expected two or more, or its option under [run]")
    _check_between(study, where)
    groups = math.prod(len(study.factors[name]) for name in study.between)
    count = math.prod(map(len, study.factors.values()))
    trials = max(count, study.users.number * study.repetitions * count // groups)
    sizes = f"{study.users.number} users, {count} conditions, {study.repetitions} repetitions"
    check_trials(where, trials, sizes)
    for (first, first_levels), (second, second_levels) in itertools.combinations(study.factors.items(), 2):
        shared = _all_words(first_levels.values()) & _all_words(second_levels.values())
        if shared:
            raise StudyError(
                f"{where}: factors {first!r} and {second!r} both set {sorted(shared)[0]!r}; expected one factor for it"
            )
    for word, owner in (("person", "users"), ("seconds", "seconds"), ("seed", "seed")):
        if word in study.run or any(word in _all_words(levels.values()) for levels in study.factors.values()):
            raise StudyError(f"{where} sets {word!r} as an option of its runs; expected {owner!r} of the study itself")


def _check_between(study: StudyConfig, where: str) -> None:
    for name in study.between:
        if name not in study.factors:
            raise StudyError(f"{where}: no factor {name!r} to vary between users; there are {', '.join(study.factors)}")
    if len(set(study.between)) < len(study.between):
        raise StudyError(f"{where}: a factor appears twice in between; expected {sorted(set(study.between))}")


def _all_words(levels: Iterable[Words]) -> set[str]:
    words: set[str] = set()
    for level in levels:
        words |= set(level)
    return words
