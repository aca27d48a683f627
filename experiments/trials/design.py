"""Design of a study: its conditions, who meets which, and in what order."""

import itertools
from collections.abc import Iterable
from typing import NamedTuple

from experiments.trials.errors import StudyError
from experiments.trials.measures import MEASURES
from experiments.trials.study_config import StudyConfig, Words

_TAKEN = ("key", "user", "repetition", "position", "seed", "state", "reason", *MEASURES)  # columns of the table


class Condition(NamedTuple):
    """A level of every factor.

    Attributes
    ----------
    levels : dict
        Name of the level by name of the factor.
    words : Words
        What they set, in the words of a run.
    """

    levels: dict[str, str]
    words: Words


class Meeting(NamedTuple):
    """A user meets a condition.

    Attributes
    ----------
    user, repetition, position : int
        Which user; for which time; as which trial of that user.
    number : int
        Of the condition among all `conditions`.
    condition : Condition
        What it is.
    """

    user: int
    repetition: int
    position: int
    number: int
    condition: Condition


def conditions(study: StudyConfig) -> tuple[Condition, ...]:
    """All combinations of levels, the last factor's changing fastest.

    Raises
    ------
    StudyError
        If the design contradicts itself.
    """
    _check(study)
    names = list(study.factors)
    made: list[Condition] = []
    for chosen in itertools.product(*study.factors.values()):
        levels = dict(zip(names, chosen, strict=True))
        words: Words = {}
        for name, level in levels.items():
            words |= study.factors[name][level]
        made.append(Condition(levels, words))
    return tuple(made)


def meetings(study: StudyConfig) -> tuple[Meeting, ...]:
    """Every trial of a study, in the order of users, and of each user's time.

    Users are dealt to the groups of factors between users in turn. Within a group, the users take the rows of a
    balanced Latin square in turn.

    Raises
    ------
    StudyError
        If the design contradicts itself.
    """
    groups: dict[tuple[str, ...], list[tuple[int, Condition]]] = {}
    for number, condition in enumerate(conditions(study)):
        group = tuple(condition.levels[name] for name in study.between)
        groups.setdefault(group, []).append((number, condition))
    dealt = list(groups.values())
    if len(dealt) > study.users.number:
        raise StudyError(
            f"study {study.name!r}: {len(dealt)} groups between users and {study.users.number} users; expected a user "
            f"or more for each, or fewer factors in between"
        )
    met: list[Meeting] = []
    for user in range(study.users.number):
        own = dealt[user % len(dealt)]
        rows = balanced_rows(len(own)) if study.order == "latin-square" else (tuple(range(len(own))),)
        row = rows[user // len(dealt) % len(rows)]
        for repetition, (place, k) in itertools.product(range(study.repetitions), enumerate(row)):
            number, condition = own[k]
            met.append(Meeting(user, repetition, repetition * len(row) + place, number, condition))
    return tuple(met)


def balanced_rows(n: int) -> tuple[tuple[int, ...], ...]:
    """Orders of n conditions in which each stands in every place, and follows every other one, equally often.

    A Latin square for even n, two of them for odd n (E. J. Williams, "Experimental designs balanced for the estimation
    of residual effects of treatments", *Australian Journal of Scientific Research* A 2, 1949): 0, 1, n−1, 2, n−2, …,
    each next row one more modulo n, and for odd n the same rows backwards.
    """
    first = [(k + 1) // 2 if k % 2 else (n - k // 2) % n for k in range(n)]
    rows = [tuple((k + shift) % n for k in first) for shift in range(n)]
    return tuple(rows if n % 2 == 0 else rows + [row[::-1] for row in rows])


def _check(study: StudyConfig) -> None:
    where = f"study {study.name!r}"
    if not study.factors:
        raise StudyError(f"{where} has no factors; expected one or more, such as stiffness = [100, 300]")
    for name, levels in study.factors.items():
        if name in _TAKEN:
            raise StudyError(
                f"{where}: factor {name!r} has the name of another column of the table; expected another one, with "
                "levels that say what they set"
            )
        if len(levels) < 2:
            had = f"one level, {next(iter(levels))!r}" if levels else "no levels"
            raise StudyError(f"{where}: factor {name!r} has {had}; expected two or more, or its words under [run]")
    _check_between(study, where)
    for (one, its), (other, others) in itertools.combinations(study.factors.items(), 2):
        shared = _words(its.values()) & _words(others.values())
        if shared:
            raise StudyError(
                f"{where}: factors {one!r} and {other!r} both set {sorted(shared)[0]!r}; expected one factor for it"
            )
    for word, owner in (("person", "users"), ("seconds", "seconds"), ("seed", "seed")):
        if word in study.run or any(word in _words(levels.values()) for levels in study.factors.values()):
            raise StudyError(f"{where} sets {word!r} as a word of its runs; expected {owner!r} of the study itself")


def _check_between(study: StudyConfig, where: str) -> None:
    for name in study.between:
        if name not in study.factors:
            raise StudyError(f"{where}: no factor {name!r} to vary between users; there are {', '.join(study.factors)}")
    if len(set(study.between)) < len(study.between):
        raise StudyError(f"{where}: a factor stands twice in between; expected {sorted(set(study.between))}")


def _words(levels: Iterable[Words]) -> set[str]:
    found: set[str] = set()
    for level in levels:
        found |= set(level)
    return found
