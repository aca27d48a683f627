"""The page of a hardware run, from its recording: forces and the safety gate's states, twin, servo timing, link."""

import html
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from controllers.safety.arming import State
from controllers.safety.faults import Fault
from experiments.files.html_page import html_page, image
from experiments.results.folder import FIGURES, REPORT
from experiments.results.pages.figures import AXES, save_figures, shade, thinned_rows
from geometry.whole_files import write_text
from sim.recording.recording import Recording
from sim.viewer.palette import FIELD, USER

SHADES = {State.ARMING: "#f1f1f4", State.RAMPING: "#e3ecf6", State.FAULT: "#f8dedb"}
_SHOWN_TIME = 2.0  # [s] of motion shown, short enough to tell the prediction from the measurement
_PAGE_STYLE = "body { max-width: 60rem; } img { width: 100%; margin: .5rem 0 1rem; }"


def write_hardware_report(folder: Path, recording: Recording, lines: Sequence[str]) -> None:
    """Draw the figures of a hardware run into its folder, and its page, report.html.

    Parameters
    ----------
    folder : Path
        Folder of the run.
    recording : Recording
        Recording with the channels of `sim.hardware.gated_servo.CHANNELS` and those of the twin.
    lines : sequence of str
        What happened, one sentence per line.
    """
    drawings = {"forces": forces_figure, "twin": twin_figure, "servo": servo_figure, "link": link_figure}
    images = (image(file, file.stem) for file in save_figures(recording, folder / FIGURES, drawings))
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    body = f"<ul>{items}</ul>{''.join(images)}"
    page = html_page(f"{recording.texts['title']}, on a device", body, _PAGE_STYLE)
    write_text(folder / REPORT, page)


def forces_figure(recording: Recording) -> Figure:
    """Force commanded by the field, force after the gate, and distance from the curve; states of the gate shaded."""
    t, asked, force = (thinned_rows(recording, name) for name in ("t", "asked", "force"))
    figure, (above, below) = _panels(2)
    above.plot(t, np.linalg.norm(asked, axis=1), color="#9aa3b2", label="requested by the field")
    above.plot(t, np.linalg.norm(force, axis=1), color=FIELD, label="let through to the motors")
    above.set(title="force on the hand", ylabel="[N]")
    below.plot(t, 1e3 * thinned_rows(recording, "distance"), color=AXES[0])
    below.set(title="distance from the curve", xlabel="t [s]", ylabel="[mm]")
    for axes in (above, below):
        _mark_states(axes, recording)
    above.legend(loc="upper right", ncols=5)
    return figure


def twin_figure(recording: Recording) -> Figure:
    """Measured and predicted motion, the distance between them, and the hand's force as estimated by the twin."""
    last = recording.channel("ticks", "t")[-1]
    t = recording.channel("ticks", "t")[:]
    some = t > last - _SHOWN_TIME
    p, predicted = (1e3 * recording.channel("ticks", name)[:] for name in ("p", "predicted"))
    figure, (motion, apart, force) = _panels(3)
    for i, color in enumerate(AXES):
        motion.plot(t[some], p[some, i], color=color, label=f"{'xyz'[i]} measured")
        motion.plot(t[some], predicted[some, i], color="#222a38", lw=0.8, ls=(0, (2, 3)), label="predicted" * (i == 0))
    motion.set(title=f"tip of the device and of its twin, the last {_SHOWN_TIME:g} s", ylabel="[mm]")
    motion.legend(loc="upper right", ncols=4)
    apart.plot(thinned_rows(recording, "t"), 1e6 * thinned_rows(recording, "apart"), color=AXES[0])
    apart.set(title="from the prediction of a tick to its measurement", ylabel="[µm]")
    sizes = np.linalg.norm(thinned_rows(recording, "hand_force"), axis=1)
    force.plot(thinned_rows(recording, "t"), sizes, color=USER)
    force.set(title="force of the hand, estimated by the twin", xlabel="t [s]", ylabel="[N]")
    return figure


def servo_figure(recording: Recording) -> Figure:
    """Complementary distribution of computing time and lateness of the ticks."""
    figure, (axes,) = _panels(1)
    for name, color, label in (("compute", FIELD, "computing"), ("lateness", AXES[1], "late")):
        values = np.sort(np.maximum(1e-6, recording.channel("ticks", name)[:]))
        share = 1.0 - np.arange(len(values)) / len(values)
        ranks = np.unique(np.geomspace(1, len(values), 500).astype(int))
        axes.loglog(1e6 * values[-ranks], share[-ranks], color=color, label=label)
    period = 1e6 / recording.rates["ticks"]
    axes.axvline(period, color="#222a38", lw=0.8, ls=(0, (4, 3)), label="a period")
    axes.set(title="times of the servo", xlabel="longer than [µs]", ylabel="fraction of ticks")
    axes.legend(loc="lower left")
    return figure


def link_figure(recording: Recording) -> Figure:
    """Quality of the link: round trip, staleness and jitter; readings lost and refused, deadlines missed."""
    figure, (times, counts) = _panels(2)
    t = thinned_rows(recording, "t")
    for name, color, label in (("round_trip", FIELD, "round trip"), ("staleness", AXES[1], "staleness"),
                              ("jitter", AXES[0], "jitter")):  # fmt: skip
        values = 1e6 * thinned_rows(recording, name)
        if np.isfinite(values).any():
            times.plot(t, values, color=color, lw=0.8, label=label)
    times.set(title="how the device answers", ylabel="[µs]", yscale="log")
    for name, color in (("lost", FIELD), ("refused", AXES[1]), ("missed", "#9aa3b2")):
        counts.plot(
            t, thinned_rows(recording, name), color=color, label="deadlines missed" if name == "missed" else name
        )
    counts.set(title="readings lost and refused, and deadlines that the servo missed, so far", xlabel="t [s]")
    for axes in (times, counts):
        if axes.lines:
            axes.legend(loc="upper left", ncols=3)
    return figure


def _panels(rows: int) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=(9.0, 1.2 + 1.9 * rows), layout="constrained")
    return figure, [figure.add_subplot(rows, 1, k + 1) for k in range(rows)]


def _mark_states(axes: Axes, recording: Recording) -> None:
    """Shade the states of the gate without full force, and mark the faults."""
    t, state, fault = (recording.channel("ticks", name)[:] for name in ("t", "state", "fault"))
    for kind, color in SHADES.items():
        shade(axes, t, state == kind, color)
    for k in np.flatnonzero((fault > 0.0) & (np.concatenate(([0.0], fault[:-1])) == 0.0))[:20]:
        axes.axvline(float(t[k]), color=AXES[1], lw=0.8)
        name = Fault(int(fault[k])).name.lower().replace("_", " ")
        axes.annotate(name, (t[k], 1.0), xycoords=("data", "axes fraction"), fontsize=7, rotation=90, va="top")
