"""The analysis of a study: contrasts, plots and replays, and report.html, the self-contained page that shows them."""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from experiments.files.html_page import NUMBERS, html_page, image, sentences, short
from experiments.trials.analysis.plots import effects_figure, levels_figure
from experiments.trials.analysis.replays import Replay, replays
from experiments.trials.analysis.sentences import three_sentences
from experiments.trials.analysis.statistics import Contrast, Statistics, statistics
from experiments.trials.analysis.trial_table import measured_columns
from experiments.trials.design.plan import Trial
from experiments.trials.design.study_config import StudyConfig
from experiments.trials.trial.measures import CONDITION_MEASURES, MEASURES
from sim.compilation.whole_files import write_text

_BODY = """<p>{question}</p>
{sentences}
<h2>Users' means</h2>
{plots}
<h2>Every measure, level against reference</h2>
<div class="wide">{table}</div>
<p class="note">Difference: of users' means, with its 95 % BCa bootstrap interval over users, each for itself. Model:
estimate of a linear mixed model in which users differ in their level and in what the factor does to them, with its
95 % interval; p by Student's t, and corrected for all {tests} contrasts of the table by Holm's method. Effect: Cohen's
d_z, mean over spread of users' own differences (people who are simulated alike make it large), or Hedges' g between
users. Grey: no difference is shown. {interactions}</p>
{remarks}
{effects}
<h2>Measures</h2>
<div class="wide"><table>{measures}</table></div>
{failures}
{replays}
<h2>The study</h2>
<pre>{study}</pre>
<p class="note">{provenance}</p>
"""


def _page(
    study: StudyConfig, text: str, said: Sequence[str], found: Statistics, plots: Mapping[str, Figure],
    failures: Mapping[str, int], shown: Sequence[Replay], provenance: str,
) -> str:  # fmt: skip
    """HTML of the page; the arguments are those of `write_report`, and plots by caption, failures by reason."""
    names = list(dict.fromkeys(contrast.measure for contrast in found.contrasts))
    effects = effects_figure(found, next(iter(study.factors)))
    body = _BODY.format(
        question=html.escape(study.question),
        sentences=sentences(said),
        plots="".join(f"<p class='note'>{html.escape(what)}</p>{image(plot, what)}" for what, plot in plots.items()),
        table=_table(found.contrasts),
        tests=sum(math.isfinite(contrast.p) for contrast in found.contrasts),
        interactions=_interactions(found),
        remarks="".join(f"<p class='note'>{html.escape(remark)}.</p>" for remark in found.remarks),
        effects="" if effects is None else f"<h2>Size of the effects</h2>{image(effects, 'effects')}",
        measures="".join(_measure_row(name) for name in names),
        failures=_failures(failures),
        replays="".join(
            f'<h2>{html.escape(r.title)}</h2><iframe title="Replay" srcdoc="{html.escape(r.page)}"></iframe>'
            for r in shown
        ),
        study=html.escape(text),
        provenance=html.escape(provenance),
    )
    return html_page(study.name, body, NUMBERS)


def _table(contrasts: Sequence[Contrast]) -> str:
    head = "".join(
        f"<th{' class=l' if name in ('factor', 'level', 'against') else ''}>{name}</th>"
        for name in ("measure", "factor", "level", "against", "mean", "reference", "difference", "model", "p", "p Holm",
                     "effect", "users")
    )  # fmt: skip
    return f"<table><tr>{head}</tr>{''.join(_row(contrast) for contrast in contrasts)}</table>"


def _row(c: Contrast) -> str:
    agree = f"{c.agree} of {c.users}" if c.agree else str(c.users)
    numbers = (
        short(c.mean), short(c.reference_mean), _with_interval(c.difference, c.low, c.high),
        _with_interval(c.model, c.model_low, c.model_high), _p_text(c.p), _p_text(c.p_holm), short(c.effect), agree,
    )  # fmt: skip
    weak = "" if c.shown else " class=weak"
    cells = "".join(f"<td>{number}</td>" for number in numbers)
    levels = "".join(f"<td class=l>{html.escape(name)}</td>" for name in (c.factor, c.level, c.reference))
    return f"<tr{weak}><td>{html.escape(MEASURES[c.measure].label)}</td>{levels}{cells}</tr>"


def _with_interval(value: float, low: float, high: float) -> str:
    ends = f" ({low:.3g} to {high:.3g})" if math.isfinite(low) and math.isfinite(high) else ""
    return short(value) + ends


def _p_text(value: float) -> str:
    return "–" if not math.isfinite(value) else "< 0.001" if value < 0.001 else f"{value:.3f}"


def _interactions(found: Statistics) -> str:
    if not found.interactions:
        return ""
    texts = ", ".join(f"{MEASURES[name].name.replace('_', ' ')} {_p_text(p)}" for name, p in found.interactions.items())
    return (
        "Whether what a factor does depends on another one (least p of differences of differences, by Holm's method): "
        f"{html.escape(texts)}."
    )


def _measure_row(name: str) -> str:
    measure = MEASURES[name]
    says = f"{measure.says}; {measure.better} is better"
    return f"<tr><td>{html.escape(measure.label)}</td><td class=says>{html.escape(says)}</td></tr>"


def _failures(failures: Mapping[str, int]) -> str:
    if not failures:
        return ""
    rows = "".join(f"<tr><td>{html.escape(reason)}</td><td>{count}</td></tr>" for reason, count in failures.items())
    return f"<h2>Trials that failed</h2><table><tr><th>reason</th><th>trials</th></tr>{rows}</table>"


_CONTRASTS_FILE = "contrasts.csv"


def write_report(
    study: StudyConfig, text: str, trials: Sequence[Trial], frame: Any, path: Path, provenance: str
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
    provenance : str
        Code, libraries and processors that the study was made with.
    """
    import pandas as pd

    measures = [name for name in measured_columns(frame) if name not in CONDITION_MEASURES]
    factors = {name: tuple(levels) for name, levels in study.factors.items()}
    found = statistics(frame, factors, study.between, measures, study.seed)
    failures = frame.loc[frame["state"].eq("failed"), "reason"].value_counts()
    said = three_sentences(study, found, frame, int(failures.sum()))
    factor, *rest = factors
    plots = {
        MEASURES[measure].says: levels_figure(frame, factor, factors[factor], rest, measure)
        for measure in dict.fromkeys((study.ease, study.cost)) if measure in measures
    }  # fmt: skip
    replay_measure = next((name for name in (study.ease, study.cost, *measures) if name in measures), None)
    shown = replays(tuple(trials), frame, replay_measure) if replay_measure else ()
    counts = {str(reason): int(count) for reason, count in failures.items()}
    write_text(path, _page(study, text, said, found, plots, counts, shown, provenance))
    rows = [asdict(contrast) for contrast in found.contrasts]
    columns = [field.name for field in fields(Contrast)]
    pd.DataFrame.from_records(rows, columns=columns).to_csv(path.with_name(_CONTRASTS_FILE), index=False)
    return found, said
