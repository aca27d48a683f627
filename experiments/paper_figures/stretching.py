"""Figures 6 and 7: a curve before and after it is stretched, and performed; and the result, rendered."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.files.curve_files import CURVE_FILE, load_curve
from experiments.paper_figures.sources import MILLIMETRES, STRETCH, recording_in, ticks
from experiments.paper_figures.space import arrows, path, workspace
from experiments.render.film import Film, Frames
from experiments.render.graphics import offscreen_backend
from experiments.results.measures.phases import performance_start
from sim.recording.recording import Recording, RecordingError
from sim.viewer.palette import CURVE, FIELD, USER

FORCE = 30.0  # drawn length of the force in the last panel [mm]
MOMENTS = 4
_WIDTH, _HEIGHT = 1280, 720


def stretching(runs: Path) -> Figure:
    """Figure 6: the curve before and after the hand has stretched it, and in FOLLOW with the force on the hand."""
    folder = runs / STRETCH
    with Recording(recording_in(folder)) as recording:
        before = MILLIMETRES * recording.arrays["curve"]
        start = _performance_start(recording)
        end = float(recording.channel("ticks", "t")[-1])
        _, editing, pressed = ticks(recording, 0.0, start, "p", "switch")
        _, performing, force = ticks(recording, start, end, "p", "force")
    bent = load_curve(folder / CURVE_FILE)
    after = MILLIMETRES * bent.point(np.linspace(bent.start, bent.end, 400))
    held_path = MILLIMETRES * np.where(pressed[:, None] > 0.5, editing, np.nan)
    peak_row = int(np.argmax(np.linalg.norm(force, axis=1)))
    figure = Figure(figsize=(9.6, 3.7), layout="constrained")
    all_points = np.concatenate((before, after, MILLIMETRES * performing))
    axes = [workspace(figure, place, all_points, 46.0, 1.25) for place in figure.add_gridspec(1, 3)]
    for ax, title in zip(axes, ("before", "after stretching", "FOLLOW"), strict=True):
        ax.set_title(title)
        path(ax, before, CURVE, "curve before", 1.8 if ax is axes[0] else 0.9, "-" if ax is axes[0] else (0, (4, 3)))
    path(axes[1], held_path, USER, "stylus, switch held", 2.4)
    path(axes[1], after, FIELD, "curve after", 1.8)
    path(axes[2], after, FIELD, "", 1.0)
    path(axes[2], MILLIMETRES * performing, USER, "stylus in FOLLOW", 1.2)
    newtons = float(np.linalg.norm(force[peak_row]))
    arrow = FORCE * force[peak_row : peak_row + 1] / newtons
    arrows(axes[2], MILLIMETRES * performing[peak_row : peak_row + 1], arrow, "#b8433a", f"force, {newtons:.2f} N", 2.4)
    handles = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5)
    return figure


def rendered_result(runs: Path) -> Figure:
    """Figure 7: the animation of the stretched curve, rendered: the figure beside the default animation."""
    folder = runs / STRETCH
    with Recording(recording_in(folder)) as recording:
        start = _performance_start(recording)
        film = Film(show="both", start=start, width=_WIDTH, height=_HEIGHT)
        frames = Frames(recording, folder, film, offscreen_backend())
        rows = np.linspace(0, len(frames) - 1, MOMENTS + 2).astype(int)[1:-1]
        pictures = [frames.frame(int(row)) for row in rows]
        frames.close()
    figure = Figure(figsize=(9.6, 5.4), layout="constrained")
    for ax, picture in zip(figure.subplots(2, 2).ravel(), pictures, strict=True):
        ax.imshow(picture, interpolation="none")
        ax.axis("off")
    return figure


def _performance_start(recording: Recording) -> float:
    """Time from which the bent curve is performed [s]; raises RecordingError if the run has no performance."""
    start = performance_start(recording)
    if start is None:
        raise RecordingError("the summary has no performance; expected that of a run in the mode stretch-then-follow")
    return start
