"""Figures 3 and 5: the cylinder of four motions with FOLLOW, and a figure with a red and two blue inputs."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.config.maps import Cylindrical
from experiments.paper_figures.silhouettes import Paint, Silhouettes, model_colour
from experiments.paper_figures.sources import COMPOSITE, CYLINDER, MILLIMETRES, curve_of, poses_at, pushed_lap, ticks
from experiments.paper_figures.space import path, workspace
from experiments.results.folder import RECORDING, clips_of, config_of
from geometry.arrays import Array
from geometry.quaternions import heading
from models.mocap.motion.clip import Clip
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, RIVERS, USER

N_POSES = 9  # evenly spaced poses of the lap
POSE_SPACING = 1.15  # between two frames [m]
RED, BLUE, PALE_BLUE, GREY = "#b8433a", "#2f6db3", "#6ea3d8", "#c9ced6"
LEGS = ("pelvis", "thigh", "shank", "foot")


def four_motion_cylinder(runs: Path) -> Figure:
    """Figure 3: four motions on the edges of a cylinder, the hand in FOLLOW between them, frames of the animation."""
    with Recording(runs / CYLINDER / RECORDING) as recording:
        config, curve = config_of(recording), curve_of(recording)
        names = [clip.name for clip in clips_of(recording)]
        start, end = pushed_lap(recording)
        _, unpushed = ticks(recording, 0.0, start, "p")
        t, pushed = ticks(recording, start, end, "p")
        times = np.linspace(t[0], t[-1], N_POSES)
        poses = poses_at(recording, times)
    if not isinstance(config.map, Cylindrical):
        raise TypeError("the run of Figure 3 is one of a cylindrical map")
    reach = config.map.reach
    ring = curve.point(np.linspace(curve.start, curve.end, 121))
    middle = np.array([*ring.mean(axis=0)[:2], ring[0, 2]])
    edges = [_edge(ring, middle, side * reach, height * reach) for height in (-1, 1) for side in (-1, 1)]
    figure = Figure(figsize=(7.2, 6.4), layout="constrained")
    grid = figure.add_gridspec(2, 1, height_ratios=(3.1, 1.0))
    ax = workspace(figure, grid[0], MILLIMETRES * np.concatenate(edges), 30.0, 1.1)
    for name, edge, color in zip(names, edges, RIVERS, strict=False):
        path(ax, MILLIMETRES * edge, color, name, 2.0)
    for k in range(0, 120, 10):
        corners = MILLIMETRES * np.array([edges[i][k] for i in (0, 1, 3, 2, 0)])
        path(ax, corners, "#d9dde4", "", 0.7)
    path(ax, MILLIMETRES * ring, CURVE, "curve φ", 1.0, (0, (4, 3)))
    path(ax, MILLIMETRES * unpushed, FIELD, "hand in FOLLOW, not pushing", 1.4)
    path(ax, MILLIMETRES * pushed, USER, "hand in FOLLOW, pushing", 1.4)
    ax.legend(loc="upper left", bbox_to_anchor=(-0.34, 1.0))
    strip = figure.add_subplot(grid[1])
    _draw_strip(strip, poses, [f"{time:.1f} s" for time in times])
    strip.set_title("frames of the animation h(p) while the hand pushes")
    return figure


def red_and_blue_inputs(runs: Path) -> Figure:
    """Figure 5: the red input moves the lower body, two blue inputs the upper; frames of the mixed animation."""
    with Recording(runs / COMPOSITE / RECORDING) as recording:
        clips, curve = clips_of(recording), curve_of(recording)
        start, end = pushed_lap(recording)
        times = np.linspace(start, min(end, start + curve.duration), N_POSES)
        poses = poses_at(recording, times)
    rows: list[tuple[str, Array, Paint]] = [
        (f"red input: {clips[0].name}", _lap_poses(clips[0]), _leg_paint(RED, GREY)),
        (f"blue input, inside: {clips[1].name}", _lap_poses(clips[1]), _leg_paint(GREY, BLUE)),
        (f"blue input, outside: {clips[2].name}", _lap_poses(clips[2]), _leg_paint(GREY, PALE_BLUE)),
        ("mixed animation", poses, _leg_paint(RED, BLUE)),
    ]
    figure = Figure(figsize=(7.2, 6.6), layout="constrained")
    for ax, (title, row, paint) in zip(figure.subplots(len(rows), 1), rows, strict=True):
        labels = [f"{time:.1f} s" for time in times] if row is poses else []
        _draw_strip(ax, row, labels, paint)
        ax.set_title(title)
    return figure


def _edge(ring: Array, middle: Array, radial_offset: float, height: float) -> Array:
    """An edge of the cylinder: the curve's circle, wider and higher [m], shape (n, 3)."""
    outwards = ring - middle
    outwards[:, 2] = 0.0
    return ring + radial_offset * outwards / np.linalg.norm(outwards, axis=1)[:, None] + np.array([0.0, 0.0, height])


def _lap_poses(clip: Clip) -> Array:
    return clip.poses[np.linspace(0, clip.n_frames - 1, N_POSES).astype(int)]


def _leg_paint(legs: str, rest: str) -> Paint:
    return lambda body, _rgba: legs if body.endswith(LEGS) else rest


def _draw_strip(ax: Axes, poses: Array, labels: list[str], paint: Paint = model_colour) -> None:
    """Poses side by side on a floor, each seen from the same side relative to its heading, with labels below."""
    silhouettes = Silhouettes()
    for k, pose in enumerate(poses):
        azimuth = float(heading(pose[3:7])) + np.pi - 0.5
        silhouettes.draw(ax, pose, (POSE_SPACING * k, 0.0), azimuth=azimuth, paint=paint)
    for k, label in enumerate(labels):
        ax.annotate(label, (POSE_SPACING * k, -0.12), ha="center", va="top", fontsize=7.5)
    ax.axhline(0.0, color="#b9bec8", lw=0.6, zorder=1)
    ax.set(aspect="equal", xlim=(-0.7, POSE_SPACING * (len(poses) - 1) + 0.7), ylim=(-0.35, 2.05))
    ax.axis("off")
