"""Plots of force, deviation and residual force over the last seconds."""

from collections import deque

import numpy as np
import viser
from viser import uplot

from experiments.live.session.desk import numbers
from geometry.arrays import Array
from sim.viewer.palette import FIELD, TUBE, USER

PLOT_SECONDS = 12.0  # [s] that are plotted


class Plots:
    """Three plots below each other; they zoom by dragging.

    Parameters
    ----------
    gui : viser.GuiApi
        GUI to which the plots are added.
    """

    def __init__(self, gui: viser.GuiApi):
        empty = np.zeros(2)
        self._force = gui.add_uplot(
            (empty, empty, empty), ({"label": "t [s]"}, _line("device [N]", FIELD), _line("hand [N]", USER)),
            title="Force [N]", height=150, scales=_TIME_SCALE,
        )  # fmt: skip
        self._distance = gui.add_uplot(
            (empty, empty), ({"label": "t [s]"}, _line("from the curve [mm]", TUBE)),
            title="Deviation [mm]", height=140, scales=_TIME_SCALE,
        )  # fmt: skip
        self._residual = gui.add_uplot(
            (empty, empty), ({"label": "t [s]"}, _line("at the root [N]", "#7a5fc0")),
            title="Residual force [N]", height=140, scales=_TIME_SCALE,
        )  # fmt: skip

    def write(self, history: deque[dict[str, Array]]) -> None:
        """Draw the last seconds of the history."""
        t, force, user, distance, residual = numbers(history, ("force", "user", "distance", "residual"), PLOT_SECONDS)
        if len(t) < 2:
            return
        distance = np.where(np.isfinite(distance), 1e3 * distance, np.nan)
        self._force.data = (t, force, user)
        self._distance.data = (t, distance)
        self._residual.data = (t, residual)


_TIME_SCALE: dict[str, uplot.Scale] = {"x": {"time": False}}


def _line(label: str, color: str) -> uplot.Series:
    return {"label": label, "stroke": color, "width": 2}
