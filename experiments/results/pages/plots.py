"""Zoomable plots over time on a run's page, with a line at the time of the replay; drawn by a script in the page."""

import html
import json
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from geometry.arrays import Array
from sim.body.falls import UP
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, USER

MAX_POINTS = 1500  # most points of a line; in a longer run each point is the largest value of its interval


class Line(NamedTuple):
    """A line of a plot: name, colour and values at equal time steps."""

    name: str
    color: str
    values: Array


class Plot(NamedTuple):
    """Lines over the time of a run, in one unit."""

    title: str
    unit: str
    lines: tuple[Line, ...]


def plots_html(recording: Recording) -> str:
    """HTML section with the plots of a recording; empty if there is nothing to plot."""
    t = recording.channel("ticks", "t")
    plots = _plots(recording)
    if not plots:
        return ""
    data = {
        "start": float(t[0]), "end": float(t[-1]),
        "plots": [
            {
                "unit": plot.unit,
                "lines": [
                    {"name": n, "color": c, "y": [float(f"{y:.4g}") for y in np.nan_to_num(values)]}
                    for n, c, values in plot.lines
                ],
            }
            for plot in plots
        ],
    }  # fmt: skip
    canvases = "".join(
        f'<div class="over-time"><b>{html.escape(plot.title)}</b> [{html.escape(plot.unit)}] '
        + " ".join(f'<span style="color:{line.color}">{html.escape(line.name)}</span>' for line in plot.lines)
        + " <output></output></div>"
        + f'<canvas class="plot" role="img" aria-label="{html.escape(plot.title)}"></canvas>'
        for plot in plots
    )
    script = files("experiments.results").joinpath("plots.js").read_text(encoding="utf-8")
    # "</" is escaped, as "</script>" in a text would end the script.
    numbers = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    return (
        f"{_STYLE}<h2>Over time</h2>{canvases}<p>Wheel or two fingers zoom, dragging moves, "
        '<button id="plot-all">all</button> shows the whole run; the red line is where the replay is.</p>'
        f'<script type="application/json" id="plot-data">{numbers}</script><script>{script}</script>'
    )


_STYLE = """<style>
canvas.plot { width: 100%; height: 9rem; touch-action: pan-y; }
.over-time { font-size: .9rem; margin-top: .8rem; color: #566072; }
.over-time b { color: #222a38; }
.over-time output { float: right; font-variant-numeric: tabular-nums; }
</style>
"""


def _plots(recording: Recording) -> list[Plot]:
    """Distance from the curve, forces, and residual and joint error of a physical figure."""
    ticks, frames = recording.groups["ticks"], recording.groups.get("frames", {})
    found: list[Plot] = []
    if "distance" in ticks:
        source = recording.texts.get("distance_from", "the curve")
        distance = Line("distance", CURVE, 1e3 * _interval_maxima(ticks["distance"][:]))
        found.append(Plot(f"distance of the hand from {source}", "mm", (distance,)))
    forces = (("force", "field", FIELD), ("user", "hand", USER))
    lines = [
        Line(name, color, _interval_maxima(np.linalg.norm(ticks[channel][:], axis=1)))
        for channel, name, color in forces
        if channel in ticks
    ]
    found += [Plot("forces", "N", tuple(lines))] * bool(lines)
    if "joint_error" in frames and "body_weight" in recording.arrays:
        weight = float(recording.arrays["body_weight"])
        up = (
            frames["down"][:] == UP if "down" in frames else np.array(1.0)
        )  # the wrench that sets a fallen figure back is no residual
        residual = 100.0 * _interval_maxima(up * np.linalg.norm(frames["residual"][:][:, :3], axis=1)) / weight
        error = np.rad2deg(_interval_maxima(frames["joint_error"][:]))
        found.append(Plot("residual force at the root", "% body weight", (Line("residual", CURVE, residual),)))
        found.append(Plot("joints, RMS angle to the animation", "°", (Line("angle", CURVE, error),)))
    return found


def _interval_maxima(values: Array) -> Array:
    """Values, or if there are more than `MAX_POINTS`, the largest of each interval, so that no peak is lost."""
    if len(values) <= MAX_POINTS:
        return values
    return np.maximum.reduceat(values, np.linspace(0, len(values), MAX_POINTS, endpoint=False).astype(int))
