"""The two scenes of a film: the workspace with the hand's forces, and the stage with the figure and its ghost."""

import itertools
from collections.abc import Sequence
from typing import Literal, NamedTuple

import mujoco
import numpy as np

from experiments.render.graphics import Canvas, Image, View
from experiments.render.shown_world import BENCH_GROUP, GHOST, STAGE_GROUP, ShownWorld, mixed_with_white
from experiments.render.timeline import Timeline
from geometry.arrays import Array
from models.humanoid.skeleton import N_POSE
from models.world.scene import FIRST_HIDDEN_GROUP
from sim.recording.recording import Recording
from sim.viewer.framing import typical_peak
from sim.viewer.palette import FIELD, USER

_MAX_HEIGHT = 100.0  # [m] farther than any figure is from the floor


def seen_geoms(model: mujoco.MjModel, prefix: str) -> tuple[int, ...]:
    """Visible geoms of the bodies whose names begin with a prefix."""
    return tuple(
        geom
        for geom in range(model.ngeom)
        if model.body(model.geom_bodyid[geom]).name.startswith(prefix) and model.geom_group[geom] < FIRST_HIDDEN_GROUP
    )


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int]) -> float:
    """Smallest height of the geoms' surfaces above the floor [m], `_MAX_HEIGHT` at most; after `mj_kinematics`."""
    floor = model.geom("floor").id
    return min(mujoco.mj_geomDistance(model, data, floor, geom, _MAX_HEIGHT, None) for geom in geoms)


Camera = Literal["three-quarter", "front", "side", "back", "above"]

# Viewing directions: azimuth relative to the figure's heading (180: from the front), elevation [degrees].
CAMERAS: dict[Camera, tuple[float, float]] = {
    "three-quarter": (205.0, -9.0),
    "front": (180.0, -6.0),
    "side": (90.0, -6.0),
    "back": (0.0, -9.0),
    "above": (205.0, -50.0),
}
GHOST_SPACING = 0.95  # distance of the ghost from the figure, to the side [m]
GHOST_DEPTH = 0.35  # and away from the camera [m]
FRAME_SCALE = 1.1  # size of the picture relative to its required contents
ARM_REACH = 0.45  # smallest visible distance to either side of a root [m]
LEGEND_HEIGHT = 0.1  # room for the legend at the bottom [m]
ARROW_LENGTH = 0.06  # drawn length of a large force [m]
TRAIL_SECONDS = 0.6  # [s] of the stylus's path that are drawn behind it
MIN_ARROW_LENGTH = 0.004  # shortest arrow that is drawn [m]

_ARROW, _ROD = mujoco.mjtGeom.mjGEOM_ARROW, mujoco.mjtGeom.mjGEOM_CAPSULE


class Clearance(NamedTuple):
    """Lowest point of a figure in a film over the floor [m], before it is drawn higher, and its time [s]."""

    lowest: float
    at: float


class Workspace:
    """The Phantom with its curves, the forces on the hand, and the recent path of the stylus."""

    def __init__(self, recording: Recording, world: ShownWorld, moments: Timeline):
        self._world, self._moments = world, moments
        self._p_WH, self._p = recording.arrays["p_WH"], recording.channel("ticks", "p")
        self._forces = {name: recording.channel("ticks", name) for name in ("force", "user")}
        peak = max(*(typical_peak(channel) for channel in self._forces.values()), 1e-9)
        self.metres_per_newton = ARROW_LENGTH / peak
        self._trail = round(TRAIL_SECONDS * recording.rates["ticks"])
        curve = self._p_WH + recording.arrays["curve"]
        middle = 0.5 * (curve.min(axis=0) + curve.max(axis=0))
        size = float(np.linalg.norm(np.ptp(curve, axis=0)))
        self._view = View(tuple(middle + np.array([0.025, 0.0, 0.035])), 0.47 + 1.6 * size, 52.0, -25.0)

    def newtons(self, row: int) -> tuple[float, float]:
        """Forces of field and hand at a row of the film [N]."""
        tick = int(self._moments.ticks[row])
        field, user = (float(np.linalg.norm(channel[tick])) for channel in self._forces.values())
        return field, user

    def picture(self, canvas: Canvas, row: int, width: int, height: int) -> Image:
        """Draw a moment; the world has been put there."""
        canvas.look(self._world.data, self._view, BENCH_GROUP)
        tick = int(self._moments.ticks[row])
        trail = self._p_WH + self._p[max(0, tick - self._trail) : tick + 1 : max(1, self._trail // 30)]
        for start, end in itertools.pairwise(trail):
            if np.linalg.norm(end - start) > 1e-5:
                canvas.connect(_ROD, start, end, 0.0014, mixed_with_white(FIELD, 0.0))
        tip = self._p_WH + self._p[tick]
        for (name, color), width_m in zip((("force", FIELD), ("user", USER)), (0.0042, 0.0034), strict=True):
            arrow = self.metres_per_newton * self._forces[name][tick]
            if np.linalg.norm(arrow) > MIN_ARROW_LENGTH:
                canvas.connect(_ARROW, tip, tip + arrow, width_m, mixed_with_white(color, 0.0))
        return canvas.picture(width, height)


class Stage:
    """The figure, or the robot arm, with the ghost beside it; neither is drawn below the floor."""

    def __init__(self, recording: Recording, world: ShownWorld, moments: Timeline, camera: Camera, aspect: float):
        self.world, self._moments = world, moments
        self._qpos = recording.channel("frames", "qpos")
        prefixes = (world.prefix,) if moments.ghost is None else (world.prefix, GHOST)
        self._geoms = {prefix: seen_geoms(world.model, prefix) for prefix in prefixes}
        self.clearance: dict[str, Clearance] = {}
        self._azimuth, self._elevation = CAMERAS[camera]
        self._distance, self._height = self._frame_camera(aspect)

    def put(self, row: int) -> None:
        """Set the world to the state of a row; a figure that is below the floor is lifted onto it."""
        qpos, world = self._qpos[int(self._moments.frames[row])].copy(), self.world
        ghost = None
        if self._moments.ghost is not None:
            ghost = self._moments.ghost[row].copy()
            ghost[:2] += self._to_ghost(row)
        elif world.has_figure:
            ghost = np.zeros(N_POSE)
            ghost[2], ghost[3::4] = -10.0, 1.0  # out of sight
        world.put(qpos, ghost)
        depths = [self._depth(prefix, geoms, row) for prefix, geoms in self._geoms.items()] if world.has_figure else []
        if any(depth > 0.0 for depth in depths):
            qpos[world.figure_at + 2] += depths[0]
            if len(depths) == 2 and ghost is not None:
                ghost[2] += depths[1]
            world.put(qpos, ghost)

    def _depth(self, prefix: str, geoms: Sequence[int], row: int) -> float:
        lowest = lowest_point(self.world.model, self.world.data, geoms)
        if prefix not in self.clearance or lowest < self.clearance[prefix].lowest:
            self.clearance[prefix] = Clearance(lowest, float(self._moments.t[row]))
        return max(0.0, -lowest)

    def picture(self, canvas: Canvas, row: int, width: int, height: int) -> Image:
        """Draw a moment; the world has been put there."""
        canvas.look(self.world.data, self._view(row), STAGE_GROUP)
        return canvas.picture(width, height)

    def _view(self, row: int) -> View:
        x, y = self._moments.floor[row] + (0.5 * self._to_ghost(row) if self._moments.ghost is not None else 0.0)
        return View((float(x), float(y), self._height), self._distance, self._view_azimuth(row), self._elevation)

    def _view_azimuth(self, row: int) -> float:
        """Azimuth of the view [degrees]."""
        return float(self._moments.heading[row]) + self._azimuth

    def _to_ghost(self, row: int) -> Array:
        """Vector from the figure to its ghost over the floor: right in the view, and away from the viewer [m]."""
        a = np.deg2rad(self._view_azimuth(row))
        return GHOST_SPACING * np.array([np.sin(a), -np.cos(a)]) + GHOST_DEPTH * np.array([np.cos(a), np.sin(a)])

    def _frame_camera(self, aspect: float) -> tuple[float, float]:
        """Distance of the camera and height of its target [m], such that everything that moves is in the picture."""
        rows = np.unique(np.linspace(0, len(self._moments.t) - 1, 40).astype(int))
        all_geoms = [geom for geoms in self._geoms.values() for geom in geoms]
        if not all_geoms:
            return 1.0, 0.0  # the stage is empty
        points: list[Array] = []
        for row in (int(row) for row in rows):
            self.put(row)
            centre = self._moments.floor[row] + (0.5 * self._to_ghost(row) if self._moments.ghost is not None else 0.0)
            a = np.deg2rad(self._view_azimuth(row))
            positions = self.world.data.geom_xpos[all_geoms]
            across = (positions[:, :2] - centre) @ np.array([np.sin(a), -np.cos(a)])
            points.append(np.column_stack((across, positions[:, 2])))
        self.clearance.clear()
        side = max(ARM_REACH, float(np.max([np.abs(cloud[:, 0]).max() for cloud in points]))) + 0.1
        top = float(np.max([cloud[:, 1].max() for cloud in points])) + 0.15
        half = FRAME_SCALE * max(0.5 * top, side / aspect)
        field = np.deg2rad(self.world.model.vis.global_.fovy)
        return half / np.tan(0.5 * field) + 0.3, 0.5 * top - LEGEND_HEIGHT
