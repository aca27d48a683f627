"""The analysis of a study: contrasts, plots and replays, and report.html, the self-contained page that shows them."""

import html
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from experiments.files.html_page import NUMBERS, html_page, image, sentences, short
from experiments.results.folder import RECORDING, world_of
from experiments.trials.analysis.sentences import three_sentences, unstable_conditions
from experiments.trials.analysis.statistics import Contrast, Statistics, statistics
from experiments.trials.design.plan import Trial
from experiments.trials.design.study_config import StudyConfig
from experiments.trials.trial.measures import CONDITION_MEASURES, MEASURES, TrialLog
from experiments.trials.trial.run_trial import MapCache, run_recorded
from geometry.whole_files import write_text
from sim.recording.recording import Recording
from sim.viewer.replay_html import replay_html

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
_USER_COLOUR, _MEAN_COLOUR = "#9aa6b8", "#1f5fbf"


class Replay(NamedTuple):
    """Replay of a trial: which one it is and why it is shown, and the replay, a complete HTML document."""

    title: str
    page: str


def chosen_trials(frame: Any, measure: str) -> dict[str, int]:
    """Row numbers of the median and the worst trial by a measure; empty if no trial has the measure."""
    values = frame.loc[frame["state"].eq("done"), measure].dropna().sort_values(kind="stable")
    if not len(values):
        return {}
    worst = values.index[-1 if MEASURES[measure].better == "less" else 0]
    return {"median": int(values.index[len(values) // 2]), "worst": int(worst)}


def replays(trials: tuple[Trial, ...], frame: Any, measure: str) -> tuple[Replay, ...]:
    """Run the median and the worst trial again, recorded, and make their replays."""
    shown: list[Replay] = []
    for rank, row in chosen_trials(frame, measure).items():
        trial, value = trials[row], float(frame[measure].iloc[row])
        design = trial.design
        levels = ", ".join(f"{factor} {level}" for factor, level in design.condition.levels.items())
        title = (
            f"The {rank} trial by {MEASURES[measure].label}, {value:.3g}: user {design.user}, {levels}, repetition "
            f"{design.repetition + 1}"
        )
        shown.append(Replay(title, _replay_page(trial)))
    return tuple(shown)


def _replay_page(trial: Trial) -> str:
    session = MapCache().session(trial.config)
    with tempfile.TemporaryDirectory(prefix="hvf-") as folder:
        run_recorded(trial.config, session, TrialLog(session.servo, session.world), Path(folder))
        with Recording(Path(folder) / RECORDING) as recording:
            return replay_html(recording, world_of(recording))


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
    """Analyse a table and write the page; returns the statistics and the sentences that the page begins with.

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

    own_measures = (name for name in MEASURES if name in frame and name not in CONDITION_MEASURES)
    measures = [name for name in own_measures if frame[name].notna().any()]
    factors = {name: tuple(levels) for name, levels in study.factors.items()}
    found = statistics(frame, factors, study.between, measures, study.seed)
    failures = frame.loc[frame["state"].eq("failed"), "reason"].value_counts()
    said = (*three_sentences(study, found, frame, int(failures.sum())), *unstable_conditions(study, frame))
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
    write_text(path.with_name(_CONTRASTS_FILE), pd.DataFrame.from_records(rows, columns=columns).to_csv(index=False))
    return found, said


def levels_figure(frame: Any, factor: str, levels: Sequence[str], rest: Sequence[str], measure: str) -> Figure:
    """Every user's mean at every level, a panel for each combination of the other factors' levels."""
    done = frame[frame["state"].eq("done") & frame[measure].notna()]
    panels: list[tuple[str, Any]] = [("", done)]
    if rest:
        panels = [(_plain(", ".join(map(str, name))), part) for name, part in done.groupby(list(rest), sort=False)]
    figure = Figure(figsize=(3.2 * len(panels) + 0.8, 3.4), layout="constrained")
    axes: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axis, (title, part) in zip(axes, panels, strict=True):
        means = part.groupby(["user", factor])[measure].mean().unstack().reindex(columns=list(levels))
        for values in means.to_numpy():
            axis.plot(range(len(levels)), values, color=_USER_COLOUR, lw=0.8, marker="o", ms=3, alpha=0.7)
        axis.plot(range(len(levels)), means.mean(), color=_MEAN_COLOUR, lw=0, marker="_", ms=28, mew=3)
        axis.set_xticks(range(len(levels)), list(map(_plain, levels)))
        axis.set_title(title, fontsize=10)
        axis.set_xlim(-0.5, len(levels) - 0.5)
        axis.grid(axis="y", alpha=0.3)
    axes[0].set_ylabel(MEASURES[measure].label)
    return figure


def _plain(name: str) -> str:
    """A name in a plot, in which a dollar sign begins no formula."""
    return name.replace("$", r"\$")


def effects_figure(found: Statistics, factor: str) -> Figure | None:
    """Effect sizes of all measures, by level of a factor; None if there are none."""
    contrasts = [c for c in found.contrasts if c.factor == factor and np.isfinite(c.effect)]
    if not contrasts:
        return None
    rows: Mapping[tuple[str, str], Contrast] = {(c.measure, c.level): c for c in contrasts}
    measures = list(dict.fromkeys(c.measure for c in contrasts))
    levels = list(dict.fromkeys(c.level for c in contrasts))
    figure = Figure(figsize=(7.0, 0.42 * len(measures) + 1.2), layout="constrained")
    axis = figure.subplots()
    for k, level in enumerate(levels):
        values = [rows[m, level].effect if (m, level) in rows else np.nan for m in measures]
        places = np.arange(len(measures)) + 0.8 * ((k + 0.5) / len(levels) - 0.5)
        axis.barh(places, values, height=0.7 / len(levels), label=_plain(level))
    axis.set_yticks(range(len(measures)), [MEASURES[m].name.replace("_", " ") for m in measures])
    axis.invert_yaxis()
    axis.axvline(0.0, color="#333", lw=0.8)
    axis.set_xscale("symlog", linthresh=1.0)
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    reference = _plain(repr(contrasts[0].reference))
    axis.set_xlabel(f"d_z or g, from {reference}\n(linear within ±1; large where users are alike)")
    figure.legend(loc="outside upper center", ncols=min(4, len(levels)), frameon=False, fontsize=9)
    axis.grid(axis="x", alpha=0.3)
    return figure
