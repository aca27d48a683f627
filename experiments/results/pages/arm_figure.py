"""The figure of a run of the robot arm: the path of its tool, and how well it is tracked."""

import numpy as np
from matplotlib.figure import Figure

from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, USER


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
