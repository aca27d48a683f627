"""A picture of a run from its recording: the Phantom with its curve, and the figure beside its animation."""

import itertools
from pathlib import Path

import matplotlib.image
import mujoco
import numpy as np
import numpy.typing as npt

from experiments.results.folder import RECORDING, world_of
from models.humanoid.skeleton import N_POSE
from models.mocap.clip import PlanarDisplacement
from models.scene import FIGURE, P_WH, PHANTOM
from sim.recording.recording import Recording
from sim.viewer.courses import courses
from sim.viewer.palette import rgb

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT = 1440, 600
DEVICE_SHARE = 0.36  # of the width
MOMENTS = 5  # of the figure, evenly over the second half of the run
SPACING = 1.25  # between them [m]
GHOST_AT = np.array([-0.75, 0.0])  # of the animation, behind the physical figure [m]
GREEN, GHOST = (0.13, 0.63, 0.27, 1.0), (0.3, 0.55, 0.85, 0.4)
OPACITY = 0.45  # of tubes
MOST_GEOMS = 20_000


class _Stage:
    """A scene to which bodies of the world are added in several states."""

    def __init__(self, model: mujoco.MjModel, renderer: mujoco.Renderer):
        self._model, self._renderer = model, renderer
        self._data = mujoco.MjData(model)
        self._option = mujoco.MjvOption()
        names = [model.body(model.geom_bodyid[geom]).name for geom in range(model.ngeom)]
        self._phantom = [name.startswith(PHANTOM) for name in names]
        self._figure = [name.startswith(FIGURE) for name in names]
        self._all_but_floor = [model.geom(geom).name != "floor" for geom in range(model.ngeom)]
        self._moving = [name.startswith((PHANTOM, FIGURE)) and name != PHANTOM + "base" for name in names]
        self.root = int(model.joint(FIGURE + "root").qposadr[0])

    def clear(self, camera: mujoco.MjvCamera, table: bool) -> None:
        """Begin a picture with what does not move: the floor, with or without the table and the device's base."""
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera, self._option)
        self._hide(0, self._moving if table else self._all_but_floor)

    def add(self, qpos: Array, figure: bool, tint: tuple[float, float, float, float] | None = None) -> None:
        """Add the figure, or the Phantom, of a configuration of the world."""
        scene = self._renderer.scene
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        first = scene.ngeom
        mujoco.mjv_addGeoms(
            self._model, self._data, self._option, mujoco.MjvPerturb(), mujoco.mjtCatBit.mjCAT_DYNAMIC, scene
        )
        self._hide(first, self._phantom if figure else self._figure)
        for geom in scene.geoms[first : scene.ngeom]:
            if tint is not None and geom.rgba[3] > 0.0:
                geom.rgba[:] = tint

    def line(
        self, start: Array, end: Array, width: float, rgba: tuple[float, float, float, float], arrow: bool
    ) -> None:
        """Add a rod or an arrow between two points of the world."""
        scene = self._renderer.scene
        kind = mujoco.mjtGeom.mjGEOM_ARROW if arrow else mujoco.mjtGeom.mjGEOM_CYLINDER
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(rgba, dtype=np.float32))
        mujoco.mjv_connector(geom, kind, width, start, end)
        scene.ngeom += 1

    def render(self) -> npt.NDArray[np.uint8]:
        """The picture, (height, width, 3)."""
        return np.asarray(self._renderer.render())

    def _hide(self, first: int, geoms: list[bool]) -> None:
        scene = self._renderer.scene
        for geom in scene.geoms[first : scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geoms[geom.objid]:
                geom.rgba[3] = 0.0


def draw_picture(folder: Path, target: Path) -> None:
    """Render the picture of a run into a PNG file (headless: with ``MUJOCO_GL=egl`` or ``osmesa``)."""
    with Recording(folder / RECORDING) as recording:
        model = world_of(recording)
        model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
        model.vis.quality.offsamples = 8
        left = round(DEVICE_SHARE * WIDTH)
        with mujoco.Renderer(model, HEIGHT, left, max_geom=MOST_GEOMS) as renderer:
            device = _device(recording, _Stage(model, renderer))
        with mujoco.Renderer(model, HEIGHT, WIDTH - left, max_geom=MOST_GEOMS) as renderer:
            figures = _figures(recording, _Stage(model, renderer))
    matplotlib.image.imsave(target, np.hstack((device, figures)))


def _camera(lookat: Array, distance: float, azimuth: float, elevation: float) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = lookat, distance, azimuth, elevation
    return camera


def _rgba(color: str) -> tuple[float, float, float, float]:
    red, green, blue = rgb(color)
    return red / 255, green / 255, blue / 255, 1.0


def _device(recording: Recording, stage: _Stage) -> npt.NDArray[np.uint8]:
    """The Phantom at the hardest push, with its curve or rivers in their tubes and the force of the field."""
    user, force, p = (recording.channel("ticks", name)[:] for name in ("user", "force", "p"))
    tick = int(np.argmax(np.linalg.norm(user, axis=1)))
    t = recording.channel("ticks", "t")[tick]
    frame = int(np.argmin(np.abs(recording.channel("frames", "t")[:] - t)))
    stage.clear(_camera(P_WH + np.array([0.06, 0.0, 0.0]), 0.75, 62.0, -20.0), table=True)
    stage.add(recording.channel("frames", "qpos")[frame], figure=False)
    drawn = courses(recording.arrays | recording.texts)
    for course in drawn:
        for start, end in itertools.pairwise(P_WH + course.points):
            stage.line(start, end, 0.0012, _rgba(course.line), arrow=False)
    path = P_WH + p[max(0, tick - 600) : tick + 1 : 20]
    for start, end in itertools.pairwise(path):
        stage.line(start, end, 0.0018, GREEN, arrow=False)
    if np.linalg.norm(force[tick]) > 0.0:
        stage.line(P_WH + p[tick], P_WH + p[tick] + 0.03 * force[tick], 0.005, GREEN, arrow=True)
    bare, radius = stage.render().astype(np.float64), float(recording.array("tube_radius")) / 3.0
    if radius > 0.0:
        for course in drawn:
            for start, end in itertools.pairwise(P_WH + course.points):
                stage.line(start, end, radius, _rgba(course.tube), arrow=False)
    # Many transparent rods one in the other would be striped.
    return np.rint((1.0 - OPACITY) * bare + OPACITY * stage.render()).astype(np.uint8)


def _figures(recording: Recording, stage: _Stage) -> npt.NDArray[np.uint8]:
    """Moments of the physical figure side by side, the animation as a ghost behind each."""
    qpos, reference = recording.channel("frames", "qpos"), recording.channel("frames", "reference")
    width = (MOMENTS - 1) * SPACING
    stage.clear(_camera(np.array([0.0, 0.0, 0.9]), 5.6, 205.0, -10.0), table=False)
    root = slice(stage.root, stage.root + N_POSE)
    for k, frame in enumerate(np.linspace(len(qpos) // 2, len(qpos) - 1, MOMENTS).astype(int)):
        state, animation = qpos[int(frame)].copy(), reference[int(frame)]
        place = np.array([0.0, 0.5 * width - k * SPACING])
        for pose, tint, at in ((state[root], None, place), (animation, GHOST, place + GHOST_AT)):
            state[root] = _facing_the_camera(animation, at).moved(pose)
            stage.add(state, figure=True, tint=tint)
    return stage.render()


def _facing_the_camera(pose: Array, place: Array) -> PlanarDisplacement:
    """The move over the floor that puts a pose at a place, facing +x."""
    w, x, y, z = pose[3:7]
    yaw = float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    c, s = np.cos(-yaw), np.sin(-yaw)
    return PlanarDisplacement(
        float(place[0] - c * pose[0] + s * pose[1]), float(place[1] - s * pose[0] - c * pose[1]), -yaw
    )
