"""report.html of a tuning: the chosen values and what they gain, with plots of the candidates."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.loop.stability import boundary
from controllers.errors import ControllerError
from experiments.certify.certify import certified_rivers
from experiments.files.html_page import NUMBERS, html_page, image, sentences, short
from experiments.tuning.contenders import Contender
from experiments.tuning.search import Candidate, pareto_front
from experiments.tuning.tune_config import TuneConfig, label_of, more_is_better

_TRIED, _FRONT, _CHOSEN, _REFUSED = "#7f8ea3", "#1f5fbf", "#d9542b", "#b04040"


def objectives_figure(config: TuneConfig, candidates: Sequence[Candidate], chosen: Candidate) -> Figure:
    """Candidates by the first two objectives with their Pareto front; for one objective, the best value over time."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axis = figure.subplots()
    tried = [c for c in candidates if c.objectives is not None]
    costs = np.array([c.objectives for c in tried])
    if len(config.objectives) == 1:
        best = np.maximum.accumulate(costs) if more_is_better(config.objectives[0]) else np.minimum.accumulate(costs)
        axis.plot(costs[:, 0], "o", color=_TRIED, ms=4, label="tried")
        axis.plot(best[:, 0], color=_FRONT, drawstyle="steps-post", label="best so far")
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_xlabel("candidate")
        axis.set_ylabel(label_of(config.objectives[0]))
        axis.set_yscale("log")
    else:
        gain_ratio = np.array([np.nan if c.margin is None else 1.0 / (1.0 + c.margin) for c in tried])
        points = axis.scatter(costs[:, 0], costs[:, 1], c=gain_ratio, s=26, cmap="viridis", label="tried")
        figure.colorbar(points, label="k_r over the critical k_r (the certificate's boundary is 1)")
        two = [c._replace(objectives=pair[:2]) for c in tried if (pair := c.objectives) is not None]
        front = pareto_front(two, config.directions[:2])
        pareto = np.array(sorted(c.objectives for c in front if c.objectives is not None))
        axis.plot(pareto[:, 0], pareto[:, 1], color=_FRONT, lw=1.2, marker="o", mfc="none", ms=9, label="front of both")
        chosen_costs = np.array(chosen.objectives)
        axis.plot(chosen_costs[:1], chosen_costs[1:2], "*", color=_CHOSEN, ms=14, label="chosen")
        axis.set_xlabel(label_of(config.objectives[0]))
        axis.set_ylabel(label_of(config.objectives[1]))
    axis.legend(framealpha=0.85, edgecolor="none", fontsize=9)
    axis.grid(alpha=0.3)
    return figure


def gains_figure(
    config: TuneConfig, candidates: Sequence[Candidate], chosen: Candidate, others: Mapping[str, Mapping[str, float]]
) -> Figure | None:
    """Candidates in the plane of stiffness and damping, with the stability boundary; None if one of them is not tuned.

    The boundary is the least over all hands of the certificate's range; None also if there is no certificate.
    """
    if not {"stiffness", "damping"} <= set(config.space):
        return None
    try:
        river = certified_rivers(config.config(chosen.values))[""]
    except ControllerError:
        return None
    span = config.space["damping"]
    damping = np.linspace(max(span.low, 1e-3), span.high, 13)
    critical = np.min([boundary(river, damping, hand) for hand in HandRange().hands()], axis=0)
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axis = figure.subplots()
    axis.fill_between(damping, critical, critical.max() * 3.0, color=_REFUSED, alpha=0.12)
    axis.plot(damping, critical, color=_REFUSED, label="certificate's boundary: unstable above")
    for state, marker, colour in (("tried", "o", _TRIED), ("given up", ".", _TRIED), ("refused", "x", _REFUSED)):
        places = np.array([(c.values["damping"], c.values["stiffness"]) for c in candidates if c.state == state])
        if len(places):
            axis.plot(places[:, 0], places[:, 1], marker, color=colour, ms=5, label=state)
    axis.plot([chosen.values["damping"]], [chosen.values["stiffness"]], "*", color=_CHOSEN, ms=14, label="chosen")
    for (name, values), marker in zip(others.items(), "sD^v", strict=False):
        axis.plot([values["damping"]], [values["stiffness"]], marker, color="#333", mfc="none", ms=8, label=name)
    axis.set_xlabel("b_d [N s/m]")
    axis.set_ylabel("k_r [N/m]")
    axis.set_yscale("log")
    axis.set_ylim(0.7 * config.space["stiffness"].low, 1.5 * max(critical.max(), config.space["stiffness"].high))
    axis.legend(framealpha=0.85, edgecolor="none", fontsize=8)
    axis.grid(alpha=0.3)
    return figure


_BODY = """{sentences}
<h2>Candidates</h2>
{plots}
<h2>On {users} users who took no part in the tuning</h2>
<div class="wide"><table>{contenders}</table></div>
<p class="note">Gain: by how much the tuned one is better, with its 95 % BCa bootstrap interval over users. The search
with the same budget simulates as many candidates, under the same certificate. Half the critical gain: the proportional
rule of Ziegler and Nichols, at the default damping.</p>
{importances}
<h2>The certificate of what was chosen</h2>
<div class="wide"><table>{verdicts}</table></div>
<h2>The tuning</h2>
<pre>{text}</pre>
"""


def tuning_page(
    config: TuneConfig, text: str, said: Sequence[str], judged: Sequence[Contender], comparisons: Sequence[Any],
    importances: Mapping[str, Mapping[str, float]], plots: Sequence[Figure | None], verdicts: Mapping[str, str],
) -> str:  # fmt: skip
    """HTML of the page; comparisons are `experiments.tuning.tuning.Comparison`, verdicts are reasons by certificate."""
    body = _BODY.format(
        sentences=sentences(said),
        plots="".join(image(plot, "plot") for plot in plots if plot is not None),
        users=config.held_back.number,
        contenders=_contenders(config, judged, comparisons),
        importances=_importances(importances),
        verdicts="".join(
            f"<tr><td>{name}</td><td class=says>{html.escape(reason)}</td></tr>" for name, reason in verdicts.items()
        ),
        text=html.escape(text),
    )
    return html_page(config.name, body, NUMBERS)


def _contenders(config: TuneConfig, judged: Sequence[Contender], comparisons: Sequence[Any]) -> str:
    head = "".join(f"<th>{html.escape(label_of(name))}</th><th>gain</th>" for name in config.objectives)
    rows = [f"<tr><th></th><th class=l>values</th><th>margin</th>{head}</tr>"]
    gains = {(c.contender, c.objective): c for c in comparisons}
    for contender in judged:
        values = ", ".join(f"{word} {value:.4g}" for word, value in contender.values.items()) or "–"
        cells = ""
        for k, objective in enumerate(config.objectives):
            gain = gains.get((contender.name, objective))
            gain_text = "" if gain is None else short(gain.better_by)
            if gain is not None and math.isfinite(gain.low):
                gain_text += f" ({gain.low:.3g} to {gain.high:.3g})"
            cells += f"<td>{short(float(contender.means[k]))}</td><td>{gain_text}</td>"
        margin = "–" if contender.stability.margin is None else f"{contender.stability.margin:.3g}"
        values_cell = f"<td class=says>{values}</td>"
        rows.append(f"<tr><td>{html.escape(contender.name)}</td>{values_cell}<td>{margin}</td>{cells}</tr>")
    return "".join(rows)


def _importances(importances: Mapping[str, Mapping[str, float]]) -> str:
    if not importances:
        return ""
    rows = "".join(
        f"<tr><td>{html.escape(label_of(objective))}</td><td>{word}</td><td>{share:.2f}</td></tr>"
        for objective, shares in importances.items() for word, share in shares.items()
    )  # fmt: skip
    return f"<h2>Which number matters</h2><table><tr><th>for</th><th>number</th><th>share</th></tr>{rows}</table>"
