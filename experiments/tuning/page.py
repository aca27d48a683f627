"""report.html of a tuning: the chosen values and what they gain, in one self-contained file."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from experiments.files.html_page import NUMBERS, html_page, image, sentences, short
from experiments.tuning.contenders import Contender
from experiments.tuning.tune_config import TuneConfig, label_of

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
            f"<tr><td>{name}</td><td class=l>{html.escape(reason)}</td></tr>" for name, reason in verdicts.items()
        ),
        text=html.escape(text),
    )
    return html_page(config.name, body, NUMBERS)


def _contenders(config: TuneConfig, judged: Sequence[Contender], comparisons: Sequence[Any]) -> str:
    head = "".join(f"<th>{html.escape(label_of(name))}</th><th>gain</th>" for name in config.objectives)
    rows = [f"<tr><th></th><th>values</th><th>margin</th>{head}</tr>"]
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
        rows.append(f"<tr><td>{html.escape(contender.name)}</td><td>{values}</td><td>{margin}</td>{cells}</tr>")
    return "".join(rows)


def _importances(importances: Mapping[str, Mapping[str, float]]) -> str:
    if not importances:
        return ""
    rows = "".join(
        f"<tr><td>{html.escape(label_of(objective))}</td><td>{word}</td><td>{share:.2f}</td></tr>"
        for objective, shares in importances.items() for word, share in shares.items()
    )  # fmt: skip
    return f"<h2>Which number matters</h2><table><tr><th>for</th><th>number</th><th>share</th></tr>{rows}</table>"
