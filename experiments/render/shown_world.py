"""The world of a recording for drawing: its bodies, a ghost of the figure, curves in their tubes, light and floor.

The model is compiled again for drawing, with curves and tubes as meshes: one surface each, which MuJoCo blends over the
background. Its qpos is the recorded one followed by that of the ghost.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from experiments.results.folder import is_device_recording, scene_of
from geometry.arrays import Array
from models.humanoid.skeleton import N_POSE, figure_spec
from models.world.scene import FIGURE, FIRST_HIDDEN_GROUP, P_WH, ROBOT, SceneConfig, device_spec, robot_spec, world_spec
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.viewer.palette import FIELD, TUBE, rgb
from sim.viewer.replay_html import drawn_tube
from sim.viewer.shapes import tube
from sim.viewer.shown import courses

Rgba = tuple[float, float, float, float]

GHOST = "ghost/"
BENT = "bent"
CURVE_RADIUS = 0.0009  # [m]
TUBE_OPACITY = 0.17  # the wall covers the inside twice: (1 − 0.17)², 69 %, of it is visible
GHOST_WHITE = 0.45  # share of white in the ghost's colour
SHADOW_REACH = 5.5  # half-width of the shadow map [m]
FIELD_OF_VIEW_DEG = 30.0  # vertical [degrees]: a ball at the upper edge is drawn 1/cos 15°, 4 % longer than wide
_WOOD_COLOR = (0.8, 0.71, 0.6, 1.0)
_FLOOR_BRIGHTNESS, _LINE_BRIGHTNESS = 0.97, 0.8  # brightness of the floor and of its lines
STAGE_GROUP, BENCH_GROUP = 1, 2  # geom groups: figure, ghost or arm on the floor; the device with its curves


@dataclass(frozen=True)
class ShownWorld:
    """A world for drawing, with the layout of its configuration.

    Attributes
    ----------
    model, data : MjModel, MjData
    kind : str
        ``physical``, ``kinematic``, ``none``, or ``robot`` for an arm in the figure's place.
    recorded : int
        Length of the recorded qpos, which is the first part of this world's qpos.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    kind: str
    recorded: int

    @property
    def prefix(self) -> str:
        """Name prefix of the bodies that follow the animation."""
        return ROBOT if self.kind == "robot" else FIGURE

    @property
    def has_figure(self) -> bool:
        """Whether there is a human figure."""
        return self.kind in ("physical", "kinematic")

    @property
    def figure_at(self) -> int:
        """Index in qpos at which the figure's pose begins."""
        return int(self.model.joint(FIGURE + "root").qposadr[0])

    def show_bent(self, shown: bool) -> None:
        """Show the bent curve, or hide it."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, BENT) >= 0:
            self.model.geom(BENT).rgba[3] = float(shown)

    def put(self, qpos: Array, ghost: Array | None = None) -> None:
        """Set the world to a recorded qpos, and its ghost to a pose."""
        self.data.qpos[: self.recorded] = qpos
        if ghost is not None:
            self.data.qpos[self.recorded : self.recorded + N_POSE] = ghost
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def shown_world(recording: Recording, width: int, height: int, bent: Array | None = None) -> ShownWorld:
    """The world of a recording, for pictures of up to width × height pixels.

    Parameters
    ----------
    recording : Recording
    width, height : int
        Largest size of a picture [pixels].
    bent : array (n, 3), optional
        Points of the bent curve, in H [m]; hidden until `ShownWorld.show_bent`.

    Raises
    ------
    SimError
        If the recording is of a device, or lacks a channel that is drawn.
    """
    if is_device_recording(recording):
        raise SimError(f"{recording.path}: is of a device, without the figure; expected the recording of a simulation")
    kind = recording.texts["figure"]
    scene = SceneConfig() if kind == "robot" else scene_of(recording)
    spec = {"robot": robot_spec, "none": device_spec}.get(kind, world_spec)(scene)
    if kind in ("physical", "kinematic"):
        figure = figure_spec(scene.stature, scene.mass)
        for geom in figure.geoms:
            geom.rgba = np.array(mixed_with_white(TUBE, GHOST_WHITE))
        spec.attach(figure, prefix=GHOST, frame=spec.worldbody.add_frame())
    _add_courses(spec, recording)
    if bent is not None:
        _add_tube(spec, BENT, bent, 1.5 * CURVE_RADIUS, mixed_with_white(FIELD, 0.0, 0.0))
    _assign_groups(spec)
    _set_lighting(spec)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    model = spec.compile()
    recorded = model.nq - (N_POSE if kind in ("physical", "kinematic") else 0)
    return ShownWorld(model, mujoco.MjData(model), kind, recorded)


def mixed_with_white(color: str, white: float, opacity: float = 1.0) -> Rgba:
    """A colour ``#rrggbb`` with a share of white."""
    red, green, blue = ((1.0 - white) * value / 255 + white for value in rgb(color))
    return red, green, blue, opacity


def _add_courses(spec: mujoco.MjSpec, recording: Recording) -> None:
    """Add every curve as a thin rod, in its tube."""
    radius = drawn_tube(recording)
    for k, course in enumerate(courses(recording.static)):
        tubes = [("curve", CURVE_RADIUS, mixed_with_white(course.line, 0.0))]
        tubes += [("tube", radius, mixed_with_white(course.tube, 0.0, TUBE_OPACITY))] * (radius > 0.0)
        for name, thickness, color in tubes:
            _add_tube(spec, f"{name}{k}", course.points, thickness, color)


def _add_tube(spec: mujoco.MjSpec, name: str, points: Array, thickness: float, color: Rgba) -> None:
    """Add a tube around points in H as one mesh."""
    vertices, faces = tube(P_WH + points, thickness)
    spec.add_mesh(
        name=name, uservert=vertices.ravel().tolist(), userface=faces.ravel().tolist(),
        smoothnormal=True, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )  # fmt: skip
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=color, contype=0, conaffinity=0
    )


def _assign_groups(spec: mujoco.MjSpec) -> None:
    """Assign visible geoms to their groups, and give the table a lighter wood."""
    for geom in spec.geoms:
        name = geom.parent.name
        if geom.name == "floor" or name.startswith((FIGURE, GHOST, ROBOT)):
            geom.group = geom.group if geom.group >= FIRST_HIDDEN_GROUP else STAGE_GROUP
        elif geom.group < FIRST_HIDDEN_GROUP:
            geom.group = BENCH_GROUP
            if name == "world" and geom.type == mujoco.mjtGeom.mjGEOM_BOX:
                geom.rgba = np.array(_WOOD_COLOR)


def _set_lighting(spec: mujoco.MjSpec) -> None:
    """Daylight with soft fill, a pale floor of tiles of half a metre, and a sky of the same white."""
    visual = spec.visual
    visual.global_.fovy = FIELD_OF_VIEW_DEG
    visual.headlight.ambient[:], visual.headlight.diffuse[:], visual.headlight.specular[:] = 0.46, 0.14, 0.0
    visual.quality.shadowsize, visual.quality.offsamples = 4096, 4
    spec.stat.extent, visual.map.shadowclip, visual.map.znear = SHADOW_REACH, 1.0, 0.01
    visual.map.haze = 0.55
    visual.rgba.haze[:] = 0.97, 0.975, 0.98, 1.0
    for light in spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.pos, light.dir = np.array([2.0, 2.2, 4.5]), np.array([-0.42, -0.38, -1.0])
        light.diffuse, light.specular, light.ambient = np.full(3, 0.6), np.full(3, 0.15), np.zeros(3)
    for texture in spec.textures:
        if texture.name == "sky":
            texture.rgb1, texture.rgb2 = np.array([0.97, 0.975, 0.98]), np.array([0.88, 0.91, 0.95])
        if texture.name == "grid":
            texture.rgb1, texture.rgb2 = np.full(3, _FLOOR_BRIGHTNESS), np.full(3, _FLOOR_BRIGHTNESS)
            texture.mark, texture.markrgb = mujoco.mjtMark.mjMARK_EDGE, np.full(3, _LINE_BRIGHTNESS)
    for material in spec.materials:
        if material.name == "floor":
            material.texrepeat, material.reflectance, material.specular = np.full(2, 2.0), 0.0, 0.0
