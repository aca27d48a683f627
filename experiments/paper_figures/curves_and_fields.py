"""Figures 1, 2 and 4: a trajectory and its vectors, a field and its map, and V + U."""

from pathlib import Path

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from controllers.fields.edited import Edited, performance
from controllers.fields.river import River, integrate
from experiments.config.modes import Follow
from experiments.paper_figures.silhouettes import Silhouettes
from experiments.paper_figures.sources import CYLINDER, MILLIMETRES, curve_of, poses_at, pushed_lap, ticks
from experiments.paper_figures.space import arrows, path, workspace
from experiments.results.folder import RECORDING, config_of
from experiments.results.pages.figures import PALE_TUBE
from geometry.arrays import Array
from geometry.quaternions import heading
from models.humanoid.skeleton import DEFAULT_STATURE
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, TUBE, USER
from sim.viewer.shown import COURSE_POINTS

ARROW_SECONDS = 0.25  # duration of motion that an arrow of Figure 1 represents [s]
MAX_ARROW_LENGTH = 22.0  # longest arrow of Figure 4 [mm]
FORCE_SCALE = 6.0  # drawn length of a force [mm/N]
N_POSES = 12  # poses around the curve
FIGURE_SCALE = 24.0  # drawn length of a metre of the figure [mm]
RING_RADIUS = 1.72  # radius of the ring of poses, in radii of the curve


def trajectory_and_vectors(runs: Path) -> Figure:
    """Figure 1: a trajectory in the workspace, its tangent vectors, and the force on a hand that is pushed off it."""
    with Recording(runs / CYLINDER / RECORDING) as recording:
        curve = curve_of(recording)
        start, end = pushed_lap(recording)
        _, p, force = ticks(recording, start, end, "p", "force")
    figure = Figure(figsize=(6.2, 4.4), layout="constrained")
    phases = np.linspace(curve.start, curve.end, COURSE_POINTS)
    ring, hand = MILLIMETRES * curve.point(phases), MILLIMETRES * p
    ax = workspace(figure, 111, np.concatenate((ring, hand)), 48.0)
    path(ax, ring, CURVE, "trajectory φ", 1.8)
    at = phases[:-1:12]
    speed = MILLIMETRES * np.array([curve.velocity(phase) for phase in at])
    arrows(ax, MILLIMETRES * curve.point(at), ARROW_SECONDS * speed, TUBE, "its vectors dφ/dt", 1.8)
    path(ax, hand, USER, "a hand that pushes", 1.1)
    force_rows = slice(None, None, max(1, len(hand) // 26))
    arrows(ax, hand[force_rows], FORCE_SCALE * force[force_rows], FIELD, "force of the field")
    ax.legend(loc="upper left", bbox_to_anchor=(-0.05, 1.02))
    return figure


def field_and_map(runs: Path) -> Figure:
    """Figure 2: the field around a curve from above, and the poses to which the map sends points of the curve."""
    with Recording(runs / CYLINDER / RECORDING) as recording:
        curve, radius = curve_of(recording), MILLIMETRES * float(recording.arrays["tube_radius"])
        start, end = pushed_lap(recording)
        _, p, force = ticks(recording, start, end, "p", "force")
        t, lap = ticks(recording, 0.0, curve.duration * 1.05, "p")
        ring = MILLIMETRES * curve.point(np.linspace(curve.start, curve.end, COURSE_POINTS))
        middle = ring.mean(axis=0)[:2]
        angles = np.unwrap(np.arctan2(*(MILLIMETRES * lap[:, :2] - middle).T[::-1]))
        target_angles = angles[0] + np.sign(angles[-1] - angles[0]) * 2.0 * np.pi * np.arange(N_POSES) / N_POSES
        rows = np.argmin(np.abs(angles[:, None] - target_angles), axis=0)
        poses = poses_at(recording, t[rows])
    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    ax = figure.subplots()
    ax.add_collection(PatchCollection([Circle((float(x), float(y)), radius) for x, y in ring[:, :2]], color=PALE_TUBE))
    ax.plot(ring[:, 0], ring[:, 1], color=CURVE, lw=1.8, label="curve φ")
    force_rows = slice(None, None, max(1, len(p) // 48))
    hand, push = MILLIMETRES * p[force_rows, :2], FORCE_SCALE * force[force_rows, :2]
    ax.plot([], [], color=PALE_TUBE, lw=7.0, label="domain of the map")
    ax.quiver(
        *hand.T, *push.T, color=FIELD, angles="xy", scale_units="xy", scale=1.0, width=0.0035, zorder=4,
        label=f"force on the hand, {FORCE_SCALE:g} mm for 1 N",
    )  # fmt: skip
    silhouettes, size = Silhouettes(), RING_RADIUS * float(np.linalg.norm(ring[0, :2] - middle))
    for row, pose in zip(rows, poses, strict=True):
        point = MILLIMETRES * lap[row, :2]
        outward = (point - middle) / np.linalg.norm(point - middle)
        x, y = (middle + size * outward - np.array([0.0, 0.5 * DEFAULT_STATURE * FIGURE_SCALE])).tolist()
        silhouettes.draw(ax, pose, (x, y), FIGURE_SCALE, float(heading(pose[3:7])) + np.pi - 0.4)
        (x, y), (u, v) = point + 4.0 * outward, middle + (size - 0.42 * FIGURE_SCALE) * outward
        ax.annotate("", (u, v), (x, y), arrowprops={"arrowstyle": "->", "color": CURVE, "lw": 0.7})
        ax.plot(*point, "o", ms=3.5, color=CURVE, zorder=5)
    ax.annotate("h", (middle[0] + 0.74 * size, middle[1] + 2.5), fontsize=12, style="italic")
    reach = size + 1.15 * FIGURE_SCALE
    ax.set(xlim=middle[0] + np.array([-reach, reach]), ylim=middle[1] + np.array([-reach, reach]), aspect="equal")
    ax.set(xlabel="x [mm]", ylabel="y [mm]")
    ax.grid(visible=False)
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def v_plus_u(runs: Path) -> Figure:
    """Figure 4: a river V, a performance that leaves it, the field U of the performance, and the integral of V + U."""
    with Recording(runs / CYLINDER / RECORDING) as recording:
        curve, mode = curve_of(recording), config_of(recording).mode
        start, end = pushed_lap(recording)
        t, p = ticks(recording, start, end, "p")
    if not isinstance(mode, Follow):
        raise TypeError("the run of Figure 4 is one of FOLLOW")
    river = River(curve, epsilon=0.08, tau=mode.damping / mode.stiffness, drag=mode.damping)
    performed = performance(t, p)
    times = t[::8] - t[0]
    course = integrate(Edited(river, (performed,), (1.0,)).flow, performed.point(0.0), times)
    rms_error = MILLIMETRES * np.sqrt(np.mean(np.sum((course - performed.point(times)) ** 2, axis=1)))
    figure = Figure(figsize=(7.2, 3.9), layout="constrained")
    ring = MILLIMETRES * curve.point(np.linspace(curve.start, curve.end, COURSE_POINTS))
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    hand, line = MILLIMETRES * p, MILLIMETRES * course
    for ax in (left, right):
        ax.plot(ring[:, 0], ring[:, 1], color=CURVE, lw=1.0, ls=(0, (4, 3)), label="φ")
        ax.plot(hand[:, 0], hand[:, 1], color=USER, lw=1.4, label="performed φ'")
        ax.set(aspect="equal", xlabel="x [mm]")
    left.set_ylabel("y [mm]")
    at = np.linspace(0.0, float(times[-1]), 30)
    points = performed.point(at)
    v = np.array([river.flow(0.0, place) for place in points])
    u = np.array([performed.velocity(time) for time in at]) - v
    seconds = MAX_ARROW_LENGTH / (MILLIMETRES * float(np.linalg.norm(u[:, :2], axis=1).max()))
    tips: list[Array] = []
    for vectors, color, name in ((v, TUBE, "V"), (u, FIELD, "U")):
        tips.append(MILLIMETRES * seconds * vectors[:, :2])
        left.quiver(
            *(MILLIMETRES * points[:, :2]).T, *tips[-1].T, color=color, angles="xy", scale_units="xy", scale=1.0,
            width=0.005, zorder=4, label=name,
        )  # fmt: skip
    left.set_title(f"V and U along φ', {1e3 * seconds:.0f} ms of motion")
    right.plot(line[:, 0], line[:, 1], color=FIELD, lw=4.0, alpha=0.45, label="integral curve of V + U")
    right.set_title(f"it is {rms_error:.1g} mm RMS from φ'")
    legends = [ax.get_legend_handles_labels() for ax in (left, right)]
    handles = {label: handle for pair in legends for handle, label in zip(*pair, strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5)
    all_points = np.concatenate((ring[:, :2], hand[:, :2], *(MILLIMETRES * points[:, :2] + tip for tip in tips)))
    reach = 1.04 * np.abs(all_points - ring.mean(axis=0)[:2]).max()
    middle = ring.mean(axis=0)
    left.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach))
    return figure
