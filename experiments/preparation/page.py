"""The page of a prepared capture: measures before and after, what was changed, pictures and a replay of both."""

from html import escape

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.files.html_page import html_page, image
from experiments.preparation.prepared_file import Measured, PreparedFile, changes, gaps
from geometry.arrays import Array
from models.humanoid.skeleton import BODIES, CONTACT_RADIUS, FOOT_CONTACTS, SEGMENTS, figure_model
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from models.mocap.preparation.looping import LoopedClip
from models.mocap.preparation.prepare import Prepared
from sim.body.clip_motion import clip_motion
from sim.viewer.actor import GHOST, Actor
from sim.viewer.framing import view_offsets
from sim.viewer.replay_page import page_of, unserved
from sim.viewer.shapes import body_shapes

_COLOURS = {"left": "#c2473b", "right": "#2f6db3"}
_PICTURE_COUNT = 14  # number of pictures in a row, evenly over the clip
_PICTURE_SPACING = 1.0  # distance between two pictures [m]
_REPLAY_FPS = 30.0  # [1/s]
_MAX_DURATION = 12.0  # longest replay [s]; cyclic clips are repeated for as long
_SIDE_OFFSET = 0.6  # distance of each figure from the middle [m]


def page(outcome: PreparedFile, captured: Measured) -> str:
    """The report as a self-contained page: measures before and after, what was changed, pictures and replay of both."""
    prepared, (before, follows, slide) = outcome.prepared, captured
    picture = image(filmstrip({"as captured": prepared.captured, "prepared": prepared.clip}), "stick figures")
    gap_before, gap = gaps(prepared)
    names = ("soles", "ends", "continuity", "dynamics", "loop", "physical figure", "slide")
    slides = tuple(f"a foot slides by {1000 * far:.0f} mm along the floor at most" for far in (slide, outcome.slide))
    captured_lines = (*before.lines(), gap_before, follows.line(), slides[0])
    prepared_lines = (*outcome.measures.lines(), gap, outcome.followed.line(), slides[1])
    rows = "".join(
        f"<tr><th>{name}</th><td>{escape(first)}</td><td>{escape(then)}</td></tr>"
        for name, first, then in zip(names, captured_lines, prepared_lines, strict=True)
    )

    def listed(title: str, lines: tuple[str, ...]) -> str:
        points = "".join(f"<li>{escape(line)}</li>" for line in lines)
        return f"<h2>{title}</h2><ul>{points}</ul>" if lines else ""

    verdict = "Not well-formed." if outcome.faults() else "Well-formed."
    body = (
        f'<p>{verdict} {escape(outcome.followed.line().capitalize())}.</p><div class="wide"><table>'
        f"<tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table></div>"
        + listed("What was changed", changes(prepared))
        + listed("Joints that differ most from the capture", tuple(e.line() for e in prepared.fidelity.extremes))
        + listed(
            "What is not within bounds, not certified, or not in the clip",
            (*outcome.faults(), *outcome.doubts, *outcome.advice()),
        )
        + f'<iframe title="both in 3D" srcdoc="{escape(both_html(prepared))}"></iframe>'
        + picture
        + listed("How the file was read", prepared.report.lines() if prepared.report else ())
    )
    style = "th, td { text-align: left; vertical-align: top; }"
    return html_page(f"{prepared.clip.name}, prepared", body, style)


def filmstrip(clips: dict[str, Clip]) -> Figure:
    """A row for every clip, with its times, seen from the side of its direction of travel, or along y if in place."""
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
        axes.text(start[0], -0.05, f"{frame / clip.fps:.1f} s", fontsize=6, ha="center", va="top")

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


def captured_beside(clip: Clip, captured: Clip, part: LoopedClip, pace: float, times: Array) -> Array:
    """Poses (n, 75) of a capture at the moments that its prepared clip shows at times (n,) [s], lap after lap.

    Where the capture has no such moment (coming to rest, the way back, a mirror image) it holds the nearest one. The
    parameters are those of `models.mocap.preparation.fidelity.fidelity`.
    """
    laps, since = np.divmod(times, clip.duration) if clip.closes(CLOSURE_TOLERANCE) else (np.zeros_like(times), times)
    own_pace = Clip(captured.poses, captured.fps * pace, captured.name)
    poses = clip_motion(own_pace, np.clip(part.start + since, 0.0, min(part.end, own_pace.duration))).poses
    for lap in range(1, int(laps.max()) + 1):
        poses[laps >= lap] = clip.displacement.moved(poses[laps >= lap])
    return poses


def both_html(prepared: Prepared) -> str:
    """The page: the capture at the back, translucent, and the prepared clip in front, at the same moments.

    A closed clip is repeated, an open one holds its last pose. Both are kept in view, and the floor moves under them.
    """
    clip = prepared.clip
    longest = max(clip.duration, _MAX_DURATION if clip.closes(CLOSURE_TOLERANCE) else 0.0)
    times = np.arange(int(min(longest, _MAX_DURATION) * _REPLAY_FPS) + 1) / _REPLAY_FPS
    beside = captured_beside(clip, prepared.captured, prepared.looped, prepared.paced.pace, times)
    model = figure_model()
    data = mujoco.MjData(model)
    with unserved() as server, server.atomic():
        scene, shapes = server.scene, body_shapes(model, "")
        figures: list[tuple[Actor, Array, Array, Array]] = []
        shown = (("captured", beside, 1.0, GHOST), ("prepared", clip_motion(clip, times).poses, -1.0, ""))
        for name, poses, side, colour in shown:
            aside = np.array([0.0, _SIDE_OFFSET * side, 0.0])
            figures.append(
                (Actor(scene, name, shapes, 1.0, colour), poses, view_offsets(poses[:, :2], _REPLAY_FPS), aside)
            )
            scene.add_label(f"/labels/{name}", name, position=aside + np.array([0.0, 0.0, 2.0]), anchor="bottom-center",
                            font_screen_scale=1.25)  # fmt: skip
        floor = scene.add_grid("/floor", infinite_grid=True, cell_size=0.25, section_size=1.0, fade_distance=10.0)
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = (2.2, -4.4, 1.7), (0.0, 0.0, 0.85), np.deg2rad(32)
        serializer = server.get_scene_serializer()
        for k in range(len(times)):
            for actor, poses, shifts, aside in figures:
                data.qpos[:] = poses[k]
                mujoco.mj_kinematics(model, data)
                actor.pose(data, np.append(shifts[k], 0.0), 1.0, aside)
            floor.position = -np.append(figures[1][2][k], 0.0) % 1.0 * np.array([1.0, 1.0, 0.0])
            serializer.insert_sleep(1.0 / _REPLAY_FPS)
        return page_of(serializer)
