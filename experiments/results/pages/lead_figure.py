"""The figure of a run in LEADING: paths of hand and humanoid from above, speed, and force over time."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.results.pages.figures import AXES, PALE_TUBE, PALE_USER, STYLE, legend_above
from geometry.arrays import Array
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, TUBE, USER

POINTS = 3000  # most points drawn of a line
BACK = (0, (4, 2.5))  # line style of the way back
SUPPORTS = ((2, PALE_TUBE, "on two feet"), (0, PALE_USER, "in flight"))  # single support stays white


def draw_lead(recording: Recording, target: Path) -> None:
    """Draw the figure of a led run from its recording."""
    with mpl.rc_context(STYLE):
        lead_figure(recording).savefig(target, dpi=150)


def lead_figure(recording: Recording) -> Figure:
    """Paths of the hand and the figure from above, forth and back; over time speed, feet in support, and force."""
    figure = Figure(figsize=(7.2, 7.0), layout="constrained")
    above, moving, feeling = figure.subplots(3, 1, height_ratios=(2.4, 1.0, 1.0))
    every = round(recording.rates["ticks"] / recording.rates["frames"])
    t = recording.channel("frames", "t")[:]
    stride, n = max(1, len(t) // POINTS), len(t)
    t, s = t[::stride], recording.channel("ticks", "phase")[: n * every : every * stride]
    turned = int(np.argmax(s))
    _draw_paths(above, recording, stride, turned)
    _draw_speed(moving, recording, t, s)
    force = recording.channel("ticks", "field")[: n * every : every * stride]
    for axis, colour in enumerate(AXES):
        feeling.plot(t, force[:, axis], color=colour, lw=0.8, label=f"along {'xyz'[axis]}")
    feeling.set(title="force of the field on the hand", xlabel="time [s]", ylabel="F [N]", xlim=(t[0], t[-1]))
    moving.tick_params(labelbottom=False)
    for ax in (moving, feeling):
        ax.axvline(t[turned], color=CURVE, lw=0.8, ls=":", label="it turns back" if ax is moving else None)
        legend_above(ax)
    return figure


def _draw_speed(ax: Axes, recording: Recording, t: Array, s: Array) -> None:
    """Speed of the figure along its path, negative on the way back, shaded by the number of feet in support."""
    feet, lap = recording.arrays["lead_support"], s / float(recording.arrays["lead_stride"])
    count = feet[(len(feet) * (lap - np.floor(lap))).astype(int) % len(feet)]
    for number, colour, name in SUPPORTS:
        held = count == number
        if held.any():
            ax.fill_between(
                t, 0.0, 1.0, where=held.tolist(), transform=ax.get_xaxis_transform(), color=colour, lw=0.0, label=name
            )
    ax.plot(t, np.gradient(s, t), color=FIELD)
    ax.set(title="speed along the path; white: on one foot", ylabel="ds/dt [m/s]", xlim=(t[0], t[-1]))


def _draw_paths(ax: Axes, recording: Recording, stride: int, turned: int) -> None:
    """Paths over the floor: the hand and the animation's root, forth and back, and the physical figure's root."""
    every, scale = round(recording.rates["ticks"] / recording.rates["frames"]), float(recording.arrays["lead_scale"])
    hand = scale * recording.channel("ticks", "p")[:][:: every * stride]
    shown = recording.channel("frames", "reference")[::stride]
    qpos = recording.channel("frames", "qpos")[::stride]
    physical = qpos[:, qpos.shape[1] - shown.shape[1] :]
    ax.plot(physical[:, 0], physical[:, 1], color=TUBE, lw=5.0, alpha=0.35, label="physical figure")
    ax.plot(hand[: turned + 1, 0], hand[: turned + 1, 1], color=USER, label="stylus, forth")
    ax.plot(hand[turned:, 0], hand[turned:, 1], color=USER, ls=BACK, label="stylus, back")
    ax.plot(shown[: turned + 1, 0], shown[: turned + 1, 1], color=FIELD, lw=1.6, label="animation, forth")
    ax.plot(shown[turned:, 0], shown[turned:, 1], color=CURVE, ls=BACK, label="animation, back")
    for name, row, place in (("start", 0, (-6, 0)), ("turn", turned, (6, 0))):
        x, y = (float(value) for value in shown[row, :2])
        ax.plot(x, y, "o", ms=4.0, color=CURVE, zorder=5)
        side = "right" if place[0] < 0 else "left"
        ax.annotate(name, (x, y), place, textcoords="offset points", ha=side, va="center", fontsize=8)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    title = f"pelvis and stylus from above, over the floor; 1 mm of the stylus is {scale:.0f} mm there"
    ax.set(title=title, xlabel="x [m]", ylabel="y [m]")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
