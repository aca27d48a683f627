"""Figures 6 to 8: a curve before and after it is stretched, and performed; the result, rendered; crossing rivers."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.files.curve_files import CURVE_FILE, load_curve
from experiments.paper_figures.sources import MILLIMETRES, RIVERS, STRETCH, ticks
from experiments.paper_figures.space import arrows, colored_path, path, workspace
from experiments.render.film import Film, Frames
from experiments.render.graphics import offscreen_backend
from experiments.results.folder import RECORDING
from experiments.results.measures.changes import river_changes
from experiments.results.measures.phases import performance_start
from sim.recording.recording import Recording, RecordingError
from sim.viewer.palette import CURVE, FIELD, USER
from sim.viewer.shown import courses

FORCE_LENGTH = 30.0  # drawn length of the force in the last panel [mm]
N_IMAGES = 4
_WIDTH, _HEIGHT = 1280, 720


def stretching(runs: Path) -> Figure:
    """Figure 6: the curve before and after the hand has stretched it, and in FOLLOW with the force on the hand."""
    folder = runs / STRETCH
    with Recording(folder / RECORDING) as recording:
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
    arrow = FORCE_LENGTH * force[peak_row : peak_row + 1] / newtons
    arrows(axes[2], MILLIMETRES * performing[peak_row : peak_row + 1], arrow, "#b8433a", f"force, {newtons:.2f} N", 2.4)
    handles = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5)
    return figure


def rendered_result(runs: Path) -> Figure:
    """Figure 7: the animation of the stretched curve, rendered: the figure beside the default animation."""
    folder = runs / STRETCH
    with Recording(folder / RECORDING) as recording:
        start = _performance_start(recording)
        film = Film(show="both", start=start, width=_WIDTH, height=_HEIGHT)
        frames = Frames(recording, folder, film, offscreen_backend())
        rows = np.linspace(0, len(frames) - 1, N_IMAGES + 2).astype(int)[1:-1]
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


MAX_POINTS = 3000  # largest number of drawn points of a path


def crossing_rivers(runs: Path) -> Figure:
    """Figure 8: three rivers, the path of a hand in the colour of its active river, and the times of changes."""
    with Recording(runs / RIVERS / RECORDING) as recording:
        drawn, changes = courses(recording.static), river_changes(recording)
        t, p, user, river = ticks(recording, 0.0, np.inf, "p", "user", "river")
    step = max(1, len(t) // MAX_POINTS)
    t, hand, river = t[::step], MILLIMETRES * p[::step], river[::step].astype(int)
    colors = [drawn[k].line if k >= 0 else "#b9bec8" for k in river]
    figure = Figure(figsize=(7.2, 6.2), layout="constrained")
    grid = figure.add_gridspec(3, 1, height_ratios=(3.4, 1.0, 0.7))
    all_points = MILLIMETRES * np.concatenate([course.points for course in drawn])
    ax = workspace(figure, grid[0], np.concatenate((all_points, hand)), 30.0, 1.2)
    for course in drawn:
        path(ax, MILLIMETRES * course.points, course.line, "", 0.9, (0, (4, 3)))
    colored_path(ax, hand, colors)
    change_rows = [int(np.searchsorted(t, change.t)) for change in changes]
    ax.plot(*hand[change_rows].T, "o", color=CURVE, ms=5.0)
    handles = [Line2D([], [], color=course.line, lw=2.0, label=f"river “{course.name}”") for course in drawn]
    handles.append(Line2D([], [], color=CURVE, marker="o", ms=5.0, lw=0.0, label="change of river"))
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(-0.36, 1.0))
    height, push = figure.add_subplot(grid[1]), figure.add_subplot(grid[2])
    for k, course in enumerate(drawn):
        height.plot(t, np.where(river == k, hand[:, 2], np.nan), color=course.line, lw=1.6)
    push.plot(t, np.linalg.norm(user[::step], axis=1), color=USER)
    for panel in (height, push):
        panel.set_xlim(t[0], t[-1])
        for change in changes:
            panel.axvline(change.t, color=CURVE, lw=0.8, ls=":")
    height.tick_params(labelbottom=False)
    height.set(ylabel="z [mm]", title="height of the hand, in the colour of the active river")
    push.set(ylabel="F [N]", xlabel="time [s]", title="force of the hand")
    return figure
