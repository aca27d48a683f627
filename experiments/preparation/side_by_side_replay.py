"""3D replay of a capture beside the prepared clip: one HTML page that plays without a network or a server."""

import contextlib
import io

import mujoco
import numpy as np
import viser

from geometry.arrays import Array
from models.humanoid.skeleton import figure_model
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from sim.body.clip_motion import clip_motion
from sim.viewer.actor import GHOST, Actor
from sim.viewer.framing import view_offsets
from sim.viewer.shapes import body_shapes

_REPLAY_FPS = 30.0  # [1/s]
_MAX_DURATION = 12.0  # longest replay [s]; cyclic clips are repeated for as long
# The only notification a replay can give is that the browser renders in software.
_PAGE_STYLE = "<style>.mantine-Notifications-root {display: none}</style>"
_SIDE_OFFSET = 0.6  # distance of each figure from the middle [m]


def both_html(captured: Clip, prepared: Clip) -> str:
    """The page: the capture at the back, translucent, and the prepared clip in front, each from its start.

    A closed clip is repeated, an open one holds its last pose. Both are kept in view, and the floor moves under them.
    """
    longest = max(captured.duration, prepared.duration, _MAX_DURATION if prepared.closes(CLOSURE_TOLERANCE) else 0.0)
    times = np.arange(int(min(longest, _MAX_DURATION) * _REPLAY_FPS) + 1) / _REPLAY_FPS
    model = figure_model()
    data = mujoco.MjData(model)
    quiet = io.StringIO()  # viser prints its address and its shutdown, which have no meaning here
    with contextlib.redirect_stdout(quiet):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        scene, shapes = server.scene, body_shapes(model, "")
        figures: list[tuple[Actor, Array, Array, Array]] = []
        for name, clip, side, colour in (("captured", captured, 1.0, GHOST), ("prepared", prepared, -1.0, "")):
            poses = clip_motion(clip, times).poses
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
        return serializer.as_html().replace("</head>", _PAGE_STYLE + "</head>", 1)
    finally:
        with contextlib.redirect_stdout(quiet):
            server.stop()
