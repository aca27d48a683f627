"""Plots of a study: users' means by level, and effect sizes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from experiments.trials.analysis.statistics import Contrast, Statistics
from experiments.trials.trial.measures import MEASURES

_USER_COLOUR, _MEAN_COLOUR = "#9aa6b8", "#1f5fbf"


def levels_figure(frame: Any, factor: str, levels: Sequence[str], rest: Sequence[str], measure: str) -> Figure:
    """Every user's mean at every level, a panel for each combination of the other factors' levels."""
    done = frame[frame["state"].eq("done") & frame[measure].notna()]
    panels: list[tuple[str, Any]] = [("", done)]
    if rest:
        panels = [(", ".join(map(str, name)), part) for name, part in done.groupby(list(rest), sort=False)]
    figure = Figure(figsize=(3.2 * len(panels) + 0.8, 3.4), layout="constrained")
    axes: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axis, (title, part) in zip(axes, panels, strict=True):
        means = part.groupby(["user", factor])[measure].mean().unstack().reindex(columns=list(levels))
        for values in means.to_numpy():
            axis.plot(range(len(levels)), values, color=_USER_COLOUR, lw=0.8, marker="o", ms=3, alpha=0.7)
        axis.plot(range(len(levels)), means.mean(), color=_MEAN_COLOUR, lw=0, marker="_", ms=28, mew=3)
        axis.set_xticks(range(len(levels)), list(levels))
        axis.set_title(title, fontsize=10)
        axis.set_xlim(-0.5, len(levels) - 0.5)
        axis.grid(axis="y", alpha=0.3)
    axes[0].set_ylabel(MEASURES[measure].label)
    return figure


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
        axis.barh(places, values, height=0.7 / len(levels), label=level)
    axis.set_yticks(range(len(measures)), [MEASURES[m].name.replace("_", " ") for m in measures])
    axis.invert_yaxis()
    axis.axvline(0.0, color="#333", lw=0.8)
    axis.set_xscale("symlog", linthresh=1.0)
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_xlabel(f"d_z or g, from {contrasts[0].reference!r}\n(linear within ±1; large where users are alike)")
    figure.legend(loc="outside upper center", ncols=min(4, len(levels)), frameon=False, fontsize=9)
    axis.grid(axis="x", alpha=0.3)
    return figure
