"""The figures of a run, drawn from its recording alone.

They read the arrays ``curve`` (m, 3), ``tube_radius``, ``motor_continuous`` (3), ``motor_peak`` (3), ``body_weight``;
the texts ``tube_name``, ``hand_does`` and ``distance_from`` (by default "tube", "pushes" and "the curve"); for rivers
``river_curves`` and ``river_names``; from the summary the time from which a bent curve is performed;
in group ``ticks`` the channels t, p, distance, force, user and torque; in group ``frames`` the channels t, joint_error,
root_error, residual, ground, flight and down. The recording has SI units and radians; the figures millimetres,
centimetres and degrees.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from experiments.files.figure_files import save_figure
from experiments.results.measures.changes import river_changes
from experiments.results.measures.phases import performance_start
from geometry.arrays import Array, Mask
from geometry.spans import spans
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, MIN_PUSH_FORCE, TUBE, USER
from sim.viewer.shown import courses

MAX_POINTS = 20_000  # most points drawn of a channel; of a longer channel every k-th row is drawn
PALE_TUBE, PALE_USER, PALE_FALL = "#dbe7f4", "#fbe3cd", "#d5d5d5"
AXES = ("#2f6db3", "#c2473b", "#7a5195")
PLAIN_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
STYLE: dict[Any, Any] = PLAIN_STYLE | {
    "axes.grid": True,
    "grid.color": "#e6e8ec",
    "axes.axisbelow": True,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.2,
    "legend.fontsize": 8.0,
}


def save_figures(
    recording: Recording, folder: Path, drawings: Mapping[str, Callable[[Recording], Figure]]
) -> list[Path]:
    """Draw figures of a recording into a folder, created if it is missing; returns their PNG files."""
    files = [folder / f"{name}.png" for name in drawings]
    for file, draw in zip(files, drawings.values(), strict=True):
        with mpl.rc_context(STYLE):
            drawing = draw(recording)
            folder.mkdir(parents=True, exist_ok=True)  # only now: a recording without rows leaves no folder
            save_figure(drawing, file, dpi=150)
    return files


def draw_figures(recording: Recording, folder: Path) -> list[Path]:
    """Draw the figures that all runs have as PNG files into a folder; returns the files, in reading order.

    Raises
    ------
    RecordingError
        If the recording lacks a channel that is drawn.
    """
    drawings: dict[str, Callable[[Recording], Figure]] = {
        "path": path_figure, "deviation": deviation_figure, "forces": forces_figure, "torques": torques_figure,
    }  # fmt: skip
    if "joint_error" in recording.groups["frames"]:
        drawings["figure"] = tracking_figure
    return save_figures(recording, folder, drawings)


def path_figure(recording: Recording) -> Figure:
    """Path of the hand with curve and tube, seen along z and along y of the hand frame H [mm]."""
    drawn, path = courses(recording.static), 1e3 * thinned_rows(recording, "p")
    radius = 1e3 * float(recording.arrays["tube_radius"])
    pushed = np.linalg.norm(thinned_rows(recording, "user"), axis=1) > MIN_PUSH_FORCE
    figure, axes = _panels(1, 2, height=3.6)
    for ax, (i, j), title in zip(axes, ((0, 1), (0, 2)), ("from above", "from the right"), strict=True):
        for course in drawn:
            points = 1e3 * course.points[:, (i, j)]
            ax.plot(*points.T, color=course.line, lw=0.8, ls=(0, (4, 3)), label=course.name or "curve φ", zorder=4)
            discs = [Circle((float(x), float(y)), radius) for x, y in points]
            ax.add_collection(PatchCollection(discs, color=PALE_TUBE, zorder=1), autolim=False)
            ax.update_datalim(np.concatenate([points - radius, points + radius]))
        if radius > 0.0:
            ax.plot([], [], color=PALE_TUBE, lw=6.0, label=_tube_name(recording))
        ax.plot(path[:, i], path[:, j], color=FIELD, label="hand", zorder=2)
        held = np.where(pushed[:, None], path, np.nan)
        if np.any(pushed):
            ax.plot(
                held[:, i], held[:, j], color=USER, lw=1.6, label=f"where the hand {_hand_action(recording)}", zorder=3
            )
        ax.margins(0.1)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set(title=title, xlabel=f"{'xyz'[i]} [mm]", ylabel=f"{'xyz'[j]} [mm]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    return figure


def deviation_figure(recording: Recording) -> Figure:
    """Distance of the hand from the curve over time [mm], pushes shaded; below, magnified to the unpushed hand."""
    t = thinned_rows(recording, "t")
    distance, radius = 1e3 * thinned_rows(recording, "distance"), 1e3 * float(recording.arrays["tube_radius"])
    pushed = np.linalg.norm(thinned_rows(recording, "user"), axis=1) > MIN_PUSH_FORCE
    figure, axes = _panels(2, 1, height=4.0)
    for ax in axes:
        shade(ax, t, pushed, PALE_USER, f"hand {_hand_action(recording)}")
        if 0.0 < radius < 1.05 * np.max(distance):
            ax.axhline(radius, color=TUBE, lw=0.8, ls="--", label=f"edge of the {_tube_name(recording)}")
        ax.plot(t, distance, color=CURVE)
        ax.set(ylabel="d [mm]", xlim=(t[0], t[-1]))
        _mark_changes(ax, recording)
    left_alone = distance if np.all(pushed) else distance[~pushed]
    source = recording.texts.get("distance_from", "the curve")
    axes[0].set(title=f"distance of the hand from {source}", ylim=(0, 1.08 * np.max(distance) + 1e-3))
    axes[1].set(title="magnified", ylim=(0, 1.5 * np.percentile(left_alone, 90) + 1e-3), xlabel="time [s]")
    if axes[0].get_legend_handles_labels()[0]:
        legend_above(axes[0])
    return figure


def forces_figure(recording: Recording) -> Figure:
    """Force of the field on the hand and force of the hand on the stylus, by component [N]."""
    t = thinned_rows(recording, "t")
    figure, axes = _panels(2, 1, height=4.2)
    for ax, name, title in zip(
        axes, ("force", "user"), ("force of the field, limited", "force of the hand"), strict=True
    ):
        force = thinned_rows(recording, name)
        ax.plot(t, np.linalg.norm(force, axis=1), color="#b9bec8", lw=2.4, label="norm")
        for axis, color in enumerate(AXES):
            ax.plot(t, force[:, axis], color=color, lw=1.0, label="xyz"[axis])
        ax.set(title=title, ylabel="F [N]", xlim=(t[0], t[-1]))
    legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure


def torques_figure(recording: Recording) -> Figure:
    """Torques of the three motors with their continuous and peak limits [mN m]."""
    t, torque = thinned_rows(recording, "t"), 1e3 * thinned_rows(recording, "torque")
    continuous = 1e3 * recording.arrays["motor_continuous"]
    peak = 1e3 * recording.arrays["motor_peak"]
    figure, axes = _panels(3, 1, height=4.8)
    for i, ax in enumerate(axes):
        ax.plot(t, torque[:, i], color=AXES[i])
        reach = 1.25 * max(float(np.max(np.abs(torque[:, i]))), float(continuous[i]))
        for name, limit, dashes in (("continuous", continuous[i], "--"), ("peak", peak[i], ":")):
            # A limit far above the torques is left out, as it would squeeze the curve.
            for line in (-limit, limit) if limit < reach else ():
                ax.axhline(line, color=CURVE, lw=0.8, ls=dashes, label=name if line > 0.0 else None)
        title = f"motor {i + 1}: {continuous[i]:.0f} mN m continuous, {peak[i]:.0f} mN m peak"
        ax.set(title=title, ylabel="τ [mN m]", xlim=(t[0], t[-1]), ylim=(-reach, reach))
    legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure


def tracking_figure(recording: Recording) -> Figure:
    """Tracking errors of the physical figure, residual force and ground force; flights and falls shaded.

    Frames in which the figure lies, or is being set back onto the animation, are left out.
    """
    t, flight = thinned_rows(recording, "t", "frames"), thinned_rows(recording, "flight", "frames") > 0.5
    down = thinned_rows(recording, "down", "frames") > 0.5
    weight = float(recording.arrays["body_weight"])
    residual = 100 * np.linalg.norm(thinned_rows(recording, "residual", "frames")[:, :3], axis=1) / weight
    ground = 100 * thinned_rows(recording, "ground", "frames")[:, 2] / weight
    curves = (
        ("joints: RMS angle to the animation", "[°]", np.rad2deg(thinned_rows(recording, "joint_error", "frames"))),
        ("root: distance to the animation", "[cm]", 1e2 * thinned_rows(recording, "root_error", "frames")),
        ("residual force at the root", "[% body weight]", residual),
        ("ground force, vertical", "[% body weight]", ground),
    )
    figure, axes = _panels(4, 1, height=6.4)
    for ax, (title, unit, values) in zip(axes, curves, strict=True):
        shade(ax, t, flight & ~down, PALE_TUBE, "flight")
        shade(ax, t, down, PALE_FALL, "fallen")
        ax.plot(t, np.where(down, np.nan, values), color=CURVE)
        ax.set(title=title, ylabel=unit, xlim=(t[0], t[-1]))
        ax.set_ylim(bottom=0)
        _mark_changes(ax, recording)
    if np.any(flight | down):
        legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure


def thinned_rows(recording: Recording, name: str, group: str = "ticks") -> Array:
    """Every k-th row of a channel (n, ...), with the smallest k by which at most `MAX_POINTS` rows are left."""
    channel = recording.channel(group, name)
    return channel[:: max(1, -(-len(channel) // MAX_POINTS))]


def _panels(rows: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(7.2, height), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=columns == 1)
    return figure, list(grid.ravel())


def legend_above(ax: Axes) -> None:
    """Put the legend in a row above the axes, where it hides no data."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1)


def _hand_action(recording: Recording) -> str:
    return recording.texts.get("hand_does", "pushes")


def _tube_name(recording: Recording) -> str:
    return recording.texts.get("tube_name", "tube")


def _mark_changes(ax: Axes, recording: Recording) -> None:
    """Draw a line at every change of river, with the new river's name, and at the start of a performance."""
    marks = [(change.t, change.after) for change in river_changes(recording)]
    if (start := performance_start(recording)) is not None:
        marks.append((start, "performed"))
    low, high = ax.get_xlim()
    last, row = -np.inf, 0
    for t, name in marks:
        # Names of marks that are close in time are put on rows below each other.
        row = row + 1 if t - last < 0.1 * (high - low) else 0
        last = t
        ax.axvline(t, color=USER, lw=0.8)
        ax.annotate(
            name, (t, 1.0), (2, -2 - 9 * row), xycoords=("data", "axes fraction"), textcoords="offset points", va="top",
            fontsize=7, color=USER,
        )  # fmt: skip


def shade(ax: Axes, t: Array, where: Mask, color: str, label: str | None = None) -> None:
    """Shade the spans of time [s] in which a mask (n,) is True; the label is that of all of them in a legend."""
    for i, (start, stop) in enumerate(spans(where)):
        ax.axvspan(float(t[start]), float(t[stop - 1]), color=color, lw=0, label=label if i == 0 else None)
