"""The picture of a run in which a figure was led: the ways of hand and figure from above, its speed, the force."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.recording import Recording
from sim.viewer.palette import CURVE, FIELD, TUBE, USER

Array = npt.NDArray[np.float64]

POINTS = 3000  # drawn of a line


def draw_lead(recording: Recording, target: Path) -> None:
    """Draw the figure of a led run from its recording."""
    lead_figure(recording).savefig(target, dpi=130)


def lead_figure(recording: Recording) -> Figure:
    """From above: where the hand led, forth and back, and the figure's way; over time: speed, support and force."""
    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    above, moving, feeling = figure.subplots(3, 1, height_ratios=(2.2, 1.0, 1.0))
    every = round(recording.rates["ticks"] / recording.rates["frames"])
    ticks, frames = recording.groups["ticks"], recording.groups["frames"]
    n = len(frames["t"])
    stride = max(1, n // POINTS)
    t, s = frames["t"][:][::stride], ticks["phase"][:][: n * every : every * stride]
    turned = int(np.argmax(s))
    _draw_ways(above, recording, stride, turned)
    feet, lap = recording.array("lead_support"), s / float(recording.array("lead_stride"))
    count = feet[(len(feet) * (lap - np.floor(lap))).astype(int) % len(feet)]
    speed = np.gradient(s, t)
    for number, colour, name in ((2, "#dbe7f4", "two feet bear"), (0, "#f6dcc4", "none does")):
        held = (count == number).tolist()
        moving.fill_between(t, speed.min(), speed.max(), where=held, color=colour, lw=0.0, label=name)
    moving.plot(t, speed, color=FIELD, label="speed along the path [m/s]")
    force = ticks["field"][:][: n * every : every * stride]
    for i, (name, colour) in enumerate((("x", CURVE), ("y", FIELD), ("z", TUBE))):
        feeling.plot(t, force[:, i], color=colour, label=f"force of the field, {name} [N]")
    feeling.set(xlabel="t [s]")
    for ax in (above, moving, feeling):
        ax.legend(frameon=False, fontsize=8, loc="upper right", ncols=3)
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(color="#e6e8ec")
    return figure


def _draw_ways(ax: Axes, recording: Recording, stride: int, turned: int) -> None:
    """The hand on the floor and the animation's root, forth and back, and the physical figure's root."""
    every = round(recording.rates["ticks"] / recording.rates["frames"])
    hand = float(recording.array("lead_scale")) * recording.channel("ticks", "p")[:][:: every * stride]
    shown = recording.channel("frames", "reference")[::stride]
    qpos = recording.channel("frames", "qpos")[::stride]
    physical = qpos[:, qpos.shape[1] - shown.shape[1] :]
    ax.plot(hand[: turned + 1, 0], hand[: turned + 1, 1], color=USER, lw=1.0, label="stylus on the floor, forth")
    ax.plot(hand[turned:, 0], hand[turned:, 1], color=USER, lw=1.0, ls=(0, (4, 3)), label="and back")
    ax.plot(physical[:, 0], physical[:, 1], color=TUBE, lw=4.0, alpha=0.5, label="pelvis of the physical figure")
    ax.plot(shown[: turned + 1, 0], shown[: turned + 1, 1], color=FIELD, lw=1.6, label="pelvis, forth")
    ax.plot(shown[turned:, 0], shown[turned:, 1], color=CURVE, lw=1.2, ls=(0, (2, 2)), label="and back")
    low, high = shown[:, 1].min() - 0.8, shown[:, 1].max() + 0.8
    ax.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(low, high))
