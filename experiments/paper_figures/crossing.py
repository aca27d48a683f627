"""Figure 8: crossing rivers, and a hand that changes from one to another."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.paper_figures.sources import MILLIMETRES, RIVERS, recording_in, ticks
from experiments.paper_figures.space import colored_path, path, workspace
from experiments.results.measures.changes import river_changes
from sim.recording.recording import Recording
from sim.viewer.courses import courses
from sim.viewer.palette import CURVE, USER

POINTS = 3000  # largest number of drawn points of a path


def crossing_rivers(runs: Path) -> Figure:
    """Figure 8: three rivers, the path of a hand in the colour of its active river, and the times of changes."""
    with Recording(recording_in(runs / RIVERS)) as recording:
        drawn, changes = courses(recording.static), river_changes(recording)
        t, p, user, river = ticks(recording, 0.0, np.inf, "p", "user", "river")
    step = max(1, len(t) // POINTS)
    t, hand, river = t[::step], MILLIMETRES * p[::step], river[::step].astype(int)
    colors = [drawn[k].line if k >= 0 else "#b9bec8" for k in river]
    figure = Figure(figsize=(7.2, 6.2), layout="constrained")
    grid = figure.add_gridspec(3, 1, height_ratios=(3.4, 1.0, 0.7))
    all_points = MILLIMETRES * np.concatenate([course.points for course in drawn])
    ax = workspace(figure, grid[0], np.concatenate((all_points, hand)), 30.0, 1.2)
    for course in drawn:
        path(ax, MILLIMETRES * course.points, course.line, "", 0.9, (0, (4, 3)))
    colored_path(ax, hand, colors, 1.6)
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
    height.set(ylabel="z [mm]", title="height of the hand, in the colour of the river that has it")
    push.set(ylabel="F [N]", xlabel="time [s]", title="force of the hand")
    return figure
