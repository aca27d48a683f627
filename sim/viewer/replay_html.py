"""The 3D replay of a recording as one HTML page that plays and scrubs without a network or a server.

Drawn from left to right: the animation h(p) (the kinematic figure, as a translucent ghost), the physical figure, and
the Phantom with stylus, curve, tube and forces. The Phantom is magnified and drawn beside the figures, since at its
true size its curve would be a few pixels wide; its axes stay parallel to the world's. A travelling figure is followed:
the floor moves under it.
"""

import mujoco
import numpy as np
import viser

from geometry.arrays import Array
from models.world.scene import FIGURE, ROBOT
from sim.recording.recording import Recording
from sim.viewer.actor import GHOST, Actor
from sim.viewer.drawn_curve import DrawnCurve
from sim.viewer.framing import typical_peak, view_offsets
from sim.viewer.palette import FIELD, MIN_PUSH_FORCE, USER, rgb
from sim.viewer.replay_page import page_of, unserved
from sim.viewer.shapes import body_prefix, body_shapes, distinct, drawn_radius, tube
from sim.viewer.shown import courses

FPS = 30.0  # [1/s]
MAX_SECONDS = 60.0  # [s] longest replay; of a longer run only the beginning is shown
MAGNIFICATION = 4.0  # drawn over true lengths of the device
PHANTOM_AT = np.array([1.95, -0.55, 1.0])  # [m] where the hand frame's origin is drawn, out of the figure's reach
GHOST_AT = np.array([-0.95, -0.65, 0.0])  # [m] offset of the ghost from the physical figure
ARROW_LENGTH = 0.6  # [m] drawn length of a large force (`typical_peak`)
TRAIL_SECONDS = 0.1  # [s] duration of each piece in which the path of the stylus appears

_BODY_LABELS = {FIGURE: ("physical figure", "animation h(p)", 2.0), ROBOT: ("robot arm", "h(p, R)", 1.6)}
"""Labels of the body that follows the animation and of the animation, and their height [m]."""


def replay_html(recording: Recording, model: mujoco.MjModel) -> str:
    """Make the replay page.

    Parameters
    ----------
    recording : Recording
        Must have the arrays ``curve`` (m, 3), the points of φ in the hand frame, ``tube_radius``, 0 for none, and
        ``p_WH``, the hand frame's origin in the world; for rivers also ``river_curves`` (k, m, 3) and ``river_names``;
        in group ``frames`` the channels t, qpos (nq) and, if there is a figure, reference (75, or 7 of a robot arm);
        in group ``ticks`` the channels t, p, force and user (3 each, hand frame).
    model : mujoco.MjModel
        The world that was recorded: bodies named ``phantom/…``, and ``figure/…`` or ``robot/…``.

    Returns
    -------
    str
        A self-contained HTML document.

    Raises
    ------
    RecordingError
        If an array or channel is missing, or the run ended before anything was recorded.
    """
    with unserved() as server, server.atomic():
        return _Stage(server.scene, recording, model).play(server)


def drawn_tube(recording: Recording) -> float:
    """`drawn_radius` of a recording's tube [m]."""
    return drawn_radius(recording.arrays["curve"], float(recording.arrays["tube_radius"]))


class _Stage:
    """The scene of a replay and its animation."""

    def __init__(self, scene: viser.SceneApi, recording: Recording, model: mujoco.MjModel):
        self._scene = scene
        self._ticks = {name: recording.channel("ticks", name) for name in ("t", "p", "force", "user")}
        # A kinematic figure is drawn once, without a ghost; there may be no figure at all.
        kind = recording.texts.get("figure", "physical")
        self._is_simulated, prefix = kind in ("physical", "robot"), body_prefix(model)
        name, animation, height = _BODY_LABELS[prefix]
        names = ("t", "qpos") if kind == "none" else ("t", "qpos", "reference")
        self._frames = {name: recording.channel("frames", name) for name in names}
        self._data = mujoco.MjData(model)
        self._model = model
        joints = (joint for joint in range(model.njnt) if model.joint(joint).name.startswith(prefix))
        first = next(joints, None)
        self._root = 0 if first is None else int(model.jnt_qposadr[first])
        self._is_travelling = first is not None and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
        self._p_WH = recording.arrays["p_WH"]
        figure = body_shapes(model, prefix)
        self._phantom = Actor(scene, "phantom", body_shapes(model, "phantom/"), MAGNIFICATION)
        self._figure = Actor(scene, "figure", figure, 1.0)
        self._ghost = Actor(scene, "ghost", figure if self._is_simulated else [], 1.0, GHOST)
        peak = max(typical_peak(self._ticks["force"]), typical_peak(self._ticks["user"]), 1e-9)
        self._arrows = {
            name: (self._arrow(name, color), ARROW_LENGTH / peak) for name, color in (("force", FIELD), ("user", USER))
        }
        self._grid = scene.add_grid(
            "/floor", infinite_grid=True, cell_size=0.25, section_size=1.0, fade_distance=12.0, shadow_opacity=0.25
        )
        for k, course in enumerate(courses(recording.static)):
            drawn = DrawnCurve(scene, f"/curve/{k}", course, 0.004, MAGNIFICATION * drawn_tube(recording))
            drawn.draw(PHANTOM_AT + MAGNIFICATION * course.points)
        self._label(
            "phantom", f"Phantom, drawn {MAGNIFICATION:g} times larger", PHANTOM_AT + np.array([0.86, 0.0, 1.1])
        )
        label_offset = np.array([0.0, 0.0, height])
        if kind != "none":
            self._label("figure", name if self._is_simulated else animation, label_offset)
        if self._is_simulated:
            self._label("ghost", animation, GHOST_AT + label_offset)

    def _label(self, name: str, text: str, position: Array) -> None:
        self._scene.add_label(
            f"/labels/{name}", text, position=position, anchor="bottom-center", font_screen_scale=1.25
        )

    def _arrow(self, name: str, color: str) -> viser.ArrowsHandle:
        return self._scene.add_arrows(
            f"/forces/{name}", np.zeros((1, 2, 3)), rgb(color), shaft_radius=0.015, head_radius=0.035, head_length=0.07
        )

    def play(self, server: viser.ViserServer) -> str:
        """Run through the recording and return the page."""
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = (4.6, -5.5, 3.3), (0.8, -0.1, 0.75), np.deg2rad(31)
        serializer = server.get_scene_serializer()
        times, frame_times = self._ticks["t"][:], self._frames["t"][:]
        n = min(int(MAX_SECONDS * FPS), int((times[-1] - times[0]) * FPS) + 1)
        replay_times = times[0] + np.arange(n) / FPS
        ticks, frames = (np.minimum(np.searchsorted(t, replay_times), len(t) - 1) for t in (times, frame_times))
        has_reference = "reference" in self._frames
        roots = np.array([self._frames["reference"][int(k)][:2] for k in frames]) if has_reference else np.zeros((n, 2))
        shifts = view_offsets(roots, FPS) if self._is_travelling else np.zeros_like(roots)
        piece = int(TRAIL_SECONDS * FPS)
        for i in range(n):
            self._show(int(ticks[i]), int(frames[i]), shifts[i])
            if i % piece == 0 and i > 0:
                self._extend_trail(i // piece, int(ticks[i - piece]), int(ticks[i]))
            serializer.insert_sleep(1 / FPS)
        return page_of(serializer)

    def _show(self, tick: int, frame: int, offset: Array) -> None:
        shift = np.array([*offset, 0.0])
        self._data.qpos[:] = self._frames["qpos"][frame]
        mujoco.mj_kinematics(self._model, self._data)
        self._phantom.pose(self._data, self._p_WH, MAGNIFICATION, PHANTOM_AT)
        self._figure.pose(self._data, shift, 1.0, np.zeros(3))
        if self._is_simulated:
            reference = self._frames["reference"][frame]
            self._data.qpos[self._root : self._root + len(reference)] = reference
            mujoco.mj_kinematics(self._model, self._data)
            self._ghost.pose(self._data, shift, 1.0, GHOST_AT)
        self._grid.position = -shift % 1.0 * np.array([1.0, 1.0, 0.0])
        tip = PHANTOM_AT + MAGNIFICATION * self._ticks["p"][tick]
        for name, (handle, scale) in self._arrows.items():
            force = self._ticks[name][tick]
            handle.points = np.array([[tip, tip + scale * force]], dtype=np.float32)
            handle.visible = bool(np.linalg.norm(force) * scale > 0.02)

    def _extend_trail(self, index: int, start: int, stop: int) -> None:
        step = max(1, (stop - start) // 12)
        points = distinct(PHANTOM_AT + MAGNIFICATION * self._ticks["p"][start : stop + 1 : step])
        if len(points) < 2:
            return
        is_pushed = np.max(np.linalg.norm(self._ticks["user"][start : stop + 1 : step], axis=1)) > MIN_PUSH_FORCE
        vertices, faces = tube(points, 0.007, sides=8)
        color = rgb(USER if is_pushed else FIELD)
        self._scene.add_mesh_simple(f"/trail/{index}", vertices, faces, color=color, cast_shadow=False)
