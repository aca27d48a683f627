"""The workspace in 3D plots: axes of H in millimetres with equal scale, arrows, paths."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from geometry.arrays import Array

_AZIMUTH = -60.0  # of the viewer [degrees]


def workspace(figure: Figure, place: Any, points: Array, elevation: float, zoom: float = 1.0) -> Axes3D:
    """3D axes of the hand frame H [mm] around points (n, 3) [mm], with equal scale."""
    ax: Any = figure.add_subplot(place, projection="3d")
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * float(np.max(high - low))
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    ax.set(zlim=(low[2] - margin, high[2] + margin), xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    ax.set_box_aspect(high - low + 2.0 * margin, zoom=zoom)
    ax.view_init(elev=elevation, azim=_AZIMUTH)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis._axinfo["grid"].update(color="#e6e8ec", linewidth=0.6)
        extent = float(np.max(high - low))
        axis.set_major_locator(MultipleLocator(10.0 if extent < 60.0 else 25.0 if extent < 150.0 else 50.0))
        axis.labelpad = 2.0
    ax.tick_params(pad=0.0, labelsize=7.5)
    return ax


def arrows(ax: Axes3D, starts: Array, vectors: Array, color: str, label: str, width: float = 1.1) -> None:
    """Arrows from points (n, 3) along vectors (n, 3), both in the axes' millimetres."""
    ax.quiver(
        *starts.T, *vectors.T, color=color, linewidth=width, arrow_length_ratio=0.28, label=label, normalize=False
    )


def path(ax: Axes3D, points: Array, color: str, label: str = "", width: float = 1.4, dashes: Any = "-") -> None:
    """A line through points (n, 3)."""
    ax.plot(*points.T, color=color, lw=width, ls=dashes, label=label or None)


def colored_path(ax: Axes3D, points: Array, colors: list[str]) -> None:
    """A line through points (n, 3), each segment in the colour of its first point."""
    pieces = np.stack((points[:-1], points[1:]), axis=1)
    ax.add_collection3d(Line3DCollection(list(pieces), colors=colors[:-1], linewidths=1.6))
