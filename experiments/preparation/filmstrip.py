"""A motion as a row of stick figures seen from the side, soles drawn on their contact points."""

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, SEGMENTS, figure_model
from models.mocap.motion.clip import Clip

_COLOURS = {"left": "#c2473b", "right": "#2f6db3"}
_PICTURE_COUNT = 14  # number of pictures in a row, evenly over the clip
_PICTURE_SPACING = 1.0  # distance between two pictures [m]


def filmstrip(clips: dict[str, Clip]) -> Figure:
    """A row for every clip, seen from the side of its direction of travel, or along y if it stays in place."""
    figure = Figure(figsize=(0.9 * _PICTURE_COUNT, 1.9 * len(clips)), layout="constrained")
    for axes, (title, clip) in zip(np.atleast_1d(figure.subplots(len(clips), 1)), clips.items(), strict=True):
        _draw_row(axes, clip)
        axes.set_title(title, loc="left", fontsize=9)
    return figure


def _draw_row(axes: Axes, clip: Clip) -> None:
    model = figure_model()
    data = mujoco.MjData(model)
    spheres = [int(model.geom(name).id) for name in FOOT_CONTACTS]
    travel = clip.poses[-1, :2] - clip.poses[0, :2]
    yaw = float(np.arctan2(travel[1], travel[0])) if np.linalg.norm(travel) > 0.5 else 0.0
    view = np.array([[np.cos(yaw), 0.0], [np.sin(yaw), 0.0], [0.0, 1.0]])
    for k, frame in enumerate(np.linspace(0, clip.n_frames - 1, _PICTURE_COUNT).astype(int)):
        data.qpos = clip.poses[frame]
        mujoco.mj_kinematics(model, data)
        origin = np.append(clip.poses[frame, :2], 0.0)
        start = np.array([_PICTURE_SPACING * k, 0.0])

        def projected(points: Array, origin: Array = origin, start: Array = start) -> Array:
            return (points - origin) @ view + start

        for body, segment in enumerate(SEGMENTS):
            if segment.parent >= 0:
                line = projected(np.array([data.xpos[1 + segment.parent], data.xpos[1 + body]]))
                colour = _COLOURS.get(segment.body.partition("_")[0], "#333333")
                axes.plot(line[:, 0], line[:, 1], color=colour, linewidth=1.0)
        head = 1 + BODIES.index("head")
        face = np.array([[0.0, 0.0, 0.13], [0.1, 0.0, 0.13]]) @ data.xmat[head].reshape(3, 3).T + data.xpos[head]
        line = projected(face)
        axes.plot(line[:, 0], line[:, 1], color="#333333", linewidth=3.0)
        for foot, side in enumerate(("left", "right")):
            corners = data.geom_xpos[[spheres[4 * foot + i] for i in (0, 1, 3, 2, 0)]] - (0.0, 0.0, CONTACT_RADIUS)
            line = projected(corners)
            axes.plot(line[:, 0], line[:, 1], color=_COLOURS[side], linewidth=1.0)
    axes.axhline(0.0, color="#999999", linewidth=0.5)
    axes.set(aspect="equal", xlim=(-0.7, _PICTURE_SPACING * _PICTURE_COUNT - 0.3), ylim=(-0.2, 2.1))
    axes.axis("off")
