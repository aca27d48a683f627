"""Figures of runs of one kind: of a led figure, of a curve that was bent, and of the robot arm."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from controllers.curves.trajectory import Trajectory
from experiments.results.pages.figures import AXES, PALE_TUBE, PALE_USER, legend_above
from geometry.arrays import Array
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, TUBE, USER

MAX_POINTS = 3000  # most points drawn of a line
BACK = (0, (4, 2.5))  # line style of the way back
SUPPORTS = ((2, PALE_TUBE, "on two feet"), (0, PALE_USER, "in flight"))  # single support stays white


def lead_figure(recording: Recording) -> Figure:
    """Paths of the hand and the figure from above, forth and back; over time speed, feet in support, and force."""
    figure = Figure(figsize=(7.2, 7.0), layout="constrained")
    above, moving, feeling = figure.subplots(3, 1, height_ratios=(2.4, 1.0, 1.0))
    every = round(recording.rates["ticks"] / recording.rates["frames"])
    t = recording.channel("frames", "t")[:]
    stride, n = max(1, len(t) // MAX_POINTS), len(t)
    t, s = t[::stride], recording.channel("ticks", "phase")[: n * every : every * stride]
    turned = int(np.argmax(s))
    _draw_paths(above, recording, stride, turned)
    _draw_speed(moving, recording, t, s)
    force = recording.channel("ticks", "force")[: n * every : every * stride]
    for axis, colour in enumerate(AXES):
        feeling.plot(t, force[:, axis], color=colour, lw=0.8, label=f"along {'xyz'[axis]}")
    feeling.set(title="force on the hand", xlabel="time [s]", ylabel="F [N]", xlim=(t[0], t[-1]))
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


def arm_figure(recording: Recording) -> Figure:
    """Path of the tool over the scaled curve of the stylus, and the tracking error of the tool over time."""
    t, tool, led = (recording.channel("frames", name)[:] for name in ("t", "tool", "led"))
    curve = recording.arrays["tool_home"] + recording.arrays["tool_scale"] * recording.arrays["curve"]
    ticks, user = recording.channel("ticks", "t")[:], recording.channel("ticks", "user")[:]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    path, error = figure.subplots(1, 2, width_ratios=(1, 1.6))
    path.plot(1e3 * tool[:, 1], 1e3 * tool[:, 2], color=FIELD, label="tool")
    path.plot(1e3 * curve[:, 1], 1e3 * curve[:, 2], color=CURVE, ls=(0, (4, 3)), lw=0.8, label="curve, scaled")
    path.set(xlabel="y [mm]", ylabel="z [mm]", title="tool, from the front", aspect="equal")
    path.legend()
    error.plot(t, 1e3 * np.linalg.norm(tool - led, axis=1), color=FIELD, label="tool from where it is led [mm]")
    error.plot(ticks, np.linalg.norm(user, axis=1), color=USER, label="force of the hand [N]")
    error.set(xlabel="time [s]", ylim=(0.0, None), title="tracking")
    error.legend(loc="upper left")
    return figure


def stretch_figure(recording: Recording, bent: Trajectory) -> Figure:
    """The curve before and after it was bent, and the path of the stylus, from above and from the right [mm]."""
    before, after = recording.arrays["curve"], bent.point(np.linspace(bent.start, bent.end, MAX_POINTS))
    path = recording.channel("ticks", "p")
    path = path[:: max(1, len(path) // MAX_POINTS)]
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
