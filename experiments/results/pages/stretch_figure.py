"""The figure of a run in which the curve was bent: the curve before and after, and the path of the stylus."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from experiments.files.curve_files import CURVE_FILE, load_curve
from experiments.results.pages.figures import STYLE
from geometry.arrays import Array
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, USER

POINTS = 2000  # most points drawn of a curve or a path


def draw_stretch(recording: Recording, folder: Path, target: Path) -> None:
    """Draw the figure of a run, from its recording and the bent curve that `save_curve` wrote into its folder."""
    bent = load_curve(folder / CURVE_FILE)
    path = recording.channel("ticks", "p")
    thin = path[:: max(1, len(path) // POINTS)]
    phases = np.linspace(bent.start, bent.end, POINTS)
    with mpl.rc_context(STYLE):
        stretch_figure(recording.arrays["curve"], bent.point(phases), thin).savefig(target, dpi=150)


def stretch_figure(before: Array, after: Array, path: Array) -> Figure:
    """The curve before and after, and the path of the stylus, from above and from the right [mm].

    Parameters
    ----------
    before, after, path : Array
        Points of the curves and of the stylus in H [m], shapes (n, 3).
    """
    figure = Figure(figsize=(7.2, 3.9), layout="constrained")
    for ax, (i, j), title in zip(
        figure.subplots(1, 2), ((0, 1), (0, 2)), ("from above", "from the right"), strict=True
    ):
        ax.plot(1e3 * path[:, i], 1e3 * path[:, j], color=USER, lw=0.7, alpha=0.7, label="stylus")
        ax.plot(1e3 * before[:, i], 1e3 * before[:, j], color=CURVE, lw=0.9, ls=(0, (4, 3)), label="curve before")
        ax.plot(1e3 * after[:, i], 1e3 * after[:, j], color=FIELD, lw=1.8, label="curve after")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set(title=title, xlabel=f"{'xyz'[i]} [mm]", ylabel=f"{'xyz'[j]} [mm]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
