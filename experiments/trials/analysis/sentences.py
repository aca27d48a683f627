"""The main results of a study in three sentences, for a skimming reader, and which conditions are not stable."""

import math
from collections.abc import Sequence
from typing import Any

from experiments.trials.analysis.effect_sizes import EQUAL_TOLERANCE
from experiments.trials.analysis.statistics import Contrast, Statistics
from experiments.trials.design.study_config import StudyConfig
from experiments.trials.trial.measures import MEASURES


def three_sentences(study: StudyConfig, found: Statistics, frame: Any, failed: int) -> tuple[str, str, str]:
    """Who did what; whether the first factor made the task easier; and what that cost.

    Parameters
    ----------
    study, found : StudyConfig, Statistics
        The study and its contrasts.
    frame : pandas.DataFrame
        Table made by `experiments.trials.analysis.trial_table.trial_table`.
    failed : int
        Number of failed trials.
    """
    factor = next(iter(study.factors))
    counts = " × ".join(str(len(levels)) for levels in study.factors.values())
    people = "One simulated person" if study.users.number == 1 else f"{study.users.number} simulated people"
    times = {1: "once", 2: "twice"}.get(study.repetitions, f"{study.repetitions} times")
    reasons = list(frame.loc[frame["state"].eq("failed"), "reason"].value_counts().index)
    others = f", and for {len(reasons) - 1} other reason{'s' * (len(reasons) > 2)}" if len(reasons) > 1 else ""
    outcome = f"of which {failed} failed ({reasons[0]}{others})" if failed else "all of which came to their end"
    first = (
        f"{people} met {counts} conditions ({', '.join(study.factors)}), "
        f"{times} each: {len(frame)} trials of {study.seconds:g} s, {outcome}."
    )
    ease, cost = (
        _answer(found.of(measure, factor), measure, factor, _missing_reason(frame, measure))
        for measure in (study.ease, study.cost)
    )
    return first, ease, cost


def unstable_conditions(study: StudyConfig, frame: Any) -> tuple[str, ...]:
    """A sentence on the conditions whose k_r is beyond the critical one; none if there are no such conditions."""
    if "margin_used" not in frame:
        return ()
    used = frame.groupby(list(study.factors), sort=False)["margin_used"].max()
    beyond = used[used > 1.0]
    if beyond.empty:
        return ()
    named: list[str] = []
    for levels, share in beyond.items():
        pairs = zip(study.factors, levels if isinstance(levels, tuple) else (levels,), strict=True)
        named.append(f"{share:.3g} times with {', '.join(f'{factor} {level}' for factor, level in pairs)}")
    return (
        f"Unstable with some hand: k_r is more than the critical one, {'; '.join(named)}. Measures of a loop that "
        "oscillates are those of a shaking device.",
    )


def _answer(contrasts: Sequence[Contrast], measure: str, factor: str, reason: str) -> str:
    name = MEASURES[measure].name.replace("_", " ")
    if not contrasts:
        return f"Of {name}, there is no result: {reason}."
    comparisons = "; ".join(_comparison(contrast) for contrast in contrasts)
    return f"{name[0].upper()}{name[1:]}, by {factor}: {comparisons}."


def _missing_reason(frame: Any, measure: str) -> str:
    """Why a measure has no contrast, in words."""
    if measure not in frame:
        return f"it needs a {MEASURES[measure].figure} figure"
    values = frame.loc[frame["state"].eq("done"), measure].dropna()
    if not len(values):
        return "no trial has it"
    return "it was the same in all trials" if values.nunique() == 1 else "no level has both it and a reference"


def _comparison(c: Contrast) -> str:
    unit = f" {MEASURES[c.measure].unit}" if MEASURES[c.measure].unit else ""
    pair = f"{_format_number(c.mean)} against {_format_number(c.reference_mean)}{unit}"
    if not (math.isfinite(c.low) and math.isfinite(c.high)):
        return f"{pair} with {c.level} and {c.reference}; no interval, for the users are too few or all alike"
    interval = f"95 % interval of the difference {_format_number(c.low)} to {_format_number(c.high)}{unit}"
    if not c.shown:
        # An interval may exclude zero by itself, but not among all comparisons.
        corrected = f"; p = {_format_number(c.p_holm)} corrected after Holm" if math.isfinite(c.p_holm) else ""
        return f"no difference shown between {c.level} and {c.reference} ({pair}; {interval}{corrected})"
    word = "lower" if c.difference < 0.0 else "higher"
    better = (c.difference < 0.0) == (MEASURES[c.measure].better == "less")
    agree = f", {c.agree} of {c.users} users" if c.agree else ""
    varies = c.most - c.least > EQUAL_TOLERANCE * abs(c.difference)
    agree += f"; {_format_number(c.least)} to {_format_number(c.most)} by condition" if varies else ""
    return (
        f"{word} ({'better' if better else 'worse'}) with {c.level} than with {c.reference} ({pair}; {interval}{agree})"
    )


def _format_number(value: float) -> str:
    return f"{value:.3g}"
