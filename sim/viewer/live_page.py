"""A page in the browser on which a world is seen while it runs."""

import time
from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt
import viser
from mjviser import ViserMujocoScene

from sim.viewer.courses import Course
from sim.viewer.palette import rgb
from sim.viewer.shapes import tube

Array = npt.NDArray[np.float64]

_FPS = 30.0
_METRES_PER_NEWTON = 0.1


class LivePage:
    """A page served to browsers on this machine; viser prints its address.

    Parameters
    ----------
    model : mujoco.MjModel
        The world; not stepped here.
    drawn : sequence of Course
        The curves.
    radius : float
        Of the tube around each [m], 0 for none.
    p_WH : array (3,)
        Origin of the hand frame in the world.
    port : int
        The next free one is taken if it is in use.
    """

    def __init__(self, model: mujoco.MjModel, drawn: Sequence[Course], radius: float, p_WH: Array, port: int = 8080):
        self._server = viser.ViserServer(host="127.0.0.1", port=port, label="haptic vector fields")
        self._scene = ViserMujocoScene(self._server, model, num_envs=1)
        self._scene.camera_tracking_enabled = False
        self._model, self._data = model, mujoco.MjData(model)
        self._p_WH = p_WH
        self._shown = 0.0
        scene = self._server.scene
        for k, course in enumerate(drawn):
            looks = (("line", 0.001, course.line, None), ("tube", radius, course.tube, 0.16))
            for name, thickness, color, opacity in looks[: 1 if radius == 0.0 else 2]:
                vertices, faces = tube(p_WH + course.points, thickness)
                scene.add_mesh_simple(
                    f"/curve/{k}/{name}", vertices, faces, color=rgb(color), opacity=opacity, side="double"
                )
        self._arrow = scene.add_arrows(
            "/force", np.zeros((1, 2, 3)), (34, 160, 70), shaft_radius=0.004, head_radius=0.01, head_length=0.02
        )
        camera = self._server.initial_camera
        camera.position, camera.look_at = p_WH + np.array([1.3, -1.5, 0.5]), p_WH + np.array([-0.1, 0.5, -0.1])
        camera.fov = np.deg2rad(45)

    def show(self, qpos: Array, p_H: Array, force_H: Array) -> None:
        """Show the state, unless the last one was shown less than a thirtieth of a second ago."""
        now = time.monotonic()
        if now - self._shown < 1 / _FPS:
            return
        self._shown = now
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        tip = self._p_WH + p_H
        with self._server.atomic():
            self._scene.update_from_mjdata(self._data)
            self._arrow.points = np.array([[tip, tip + _METRES_PER_NEWTON * force_H]], dtype=np.float32)

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()
