"""Writes the analysis of a study's table: contrasts, plots, replays, and the page that contains them."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from experiments.trials.analysis.page import Report
from experiments.trials.analysis.plots import effects_figure, levels_figure
from experiments.trials.analysis.replays import replays
from experiments.trials.analysis.sentences import three_sentences
from experiments.trials.analysis.statistics import Contrast, Statistics, statistics
from experiments.trials.analysis.trial_table import measured_columns
from experiments.trials.design.plan import Trial
from experiments.trials.design.study_config import StudyConfig
from experiments.trials.trial.measures import CONDITION_MEASURES, MEASURES

_CONTRASTS_FILE = "contrasts.csv"


def write_report(
    study: StudyConfig, text: str, trials: Sequence[Trial], frame: Any, path: Path, made: str
) -> tuple[Statistics, tuple[str, ...]]:
    """Analyse a table and write the page; returns the statistics and the three sentences.

    Parameters
    ----------
    study, text : StudyConfig, str
        The study and the text of its file.
    trials : sequence of Trial
        Planned trials, in the order of the table.
    frame : pandas.DataFrame
        The table.
    path : Path
        HTML file; the contrasts are written beside it.
    made : str
        Code, libraries and processors that the study was made with.
    """
    import pandas as pd

    measures = [name for name in measured_columns(frame) if name not in CONDITION_MEASURES]
    factors = {name: tuple(levels) for name, levels in study.factors.items()}
    found = statistics(frame, factors, study.between, measures, study.seed)
    failures = frame.loc[frame["state"].eq("failed"), "reason"].value_counts()
    sentences = three_sentences(study, found, frame, int(failures.sum()))
    factor, *rest = factors
    plots = {
        MEASURES[measure].says: levels_figure(frame, factor, factors[factor], rest, measure)
        for measure in dict.fromkeys((study.ease, study.cost)) if measure in measures
    }  # fmt: skip
    replay_measure = next((name for name in (study.ease, study.cost, *measures) if name in measures), None)
    shown = replays(tuple(trials), frame, replay_measure) if replay_measure else ()
    counts = {str(reason): int(count) for reason, count in failures.items()}
    page = Report(study, text, sentences, found, plots, effects_figure(found, factor), counts, shown, made).page()
    path.write_text(page, encoding="utf-8")
    rows = [asdict(contrast) for contrast in found.contrasts]
    columns = [field.name for field in fields(Contrast)]
    pd.DataFrame.from_records(rows, columns=columns).to_csv(path.with_name(_CONTRASTS_FILE), index=False)
    return found, sentences
