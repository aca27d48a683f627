"""Renders a still of a run from its recording: the Phantom at the hardest push, poses of the figure and its ghost."""

from pathlib import Path

import matplotlib.image
import numpy as np

from experiments.render.graphics import Canvas, Image, View, offscreen_backend
from experiments.render.scenes import Stage, Workspace
from experiments.render.shown_world import SHADOW_REACH, STAGE_GROUP, ShownWorld, shown_world
from experiments.render.timeline import Timeline, timeline
from experiments.results.folder import RECORDING
from geometry.arrays import Array
from geometry.quaternions import heading
from geometry.whole_files import atomic_file
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import PlanarDisplacement
from sim.errors import SimError
from sim.recording.recording import Recording

WIDTH, HEIGHT, FPS = 1440, 600, 30.0
SUPERSAMPLING = 3  # supersampling factor of rows and columns
DEVICE_REACH = 0.8  # half-width of the region that casts shadows on the device [m]
DEVICE_SHARE = 0.34  # share of the width for the device
N_POSES = 4  # poses of the figure, evenly spaced over the second half of the run
POSE_SPACING = 1.1  # distance between them [m]
GHOST_AT = np.array([-0.95, 0.45])  # position of the ghost relative to the figure: behind, and to its left [m]
_VIEW = View((-0.2, 0.15, 0.8), 6.5, 180.0, -9.0)


def draw_picture(folder: Path, target: Path, overwrite: bool) -> None:
    """Render the picture of a run into a PNG file.

    Raises
    ------
    SimError
        If the recording cannot be drawn, the target is no PNG file or exists and is not to be overwritten, or this
        machine cannot draw.
    """
    if target.suffix.lower() != ".png" or target.is_dir():
        raise SimError(f"{target}: is not a PNG file; expected a name that ends in .png")
    if target.exists() and not overwrite:
        raise SimError(f"{target} exists and is left as it is; expected a new name, or --overwrite")
    with Recording(folder / RECORDING) as recording:
        world = shown_world(recording, SUPERSAMPLING * WIDTH, SUPERSAMPLING * HEIGHT)
        moments = timeline(recording, folder, world, FPS, 0.0, None, "default")
        left, backend = round(DEVICE_SHARE * WIDTH) if world.has_figure else WIDTH, offscreen_backend()
        with Canvas(world.model, backend, 20_000, DEVICE_REACH) as canvas:
            picture = _draw_device(recording, world, moments, canvas, SUPERSAMPLING * left)
        if world.has_figure:
            with Canvas(world.model, backend, 20_000, SHADOW_REACH) as canvas:
                figures = _draw_figures(recording, world, moments, canvas, SUPERSAMPLING * (WIDTH - left))
            picture = np.hstack((picture, figures))
    # Supersampling: each pixel is the mean of several, which smooths edges of shadows and limbs.
    pixels = picture.reshape(HEIGHT, SUPERSAMPLING, WIDTH, SUPERSAMPLING, 3).mean(axis=(1, 3))
    with atomic_file(target) as file:
        matplotlib.image.imsave(file, np.rint(pixels).astype(np.uint8), format="png")


def _draw_device(recording: Recording, world: ShownWorld, moments: Timeline, canvas: Canvas, width: int) -> Image:
    """The workspace at the hardest push across x, the direction of the stylus, which would hide an arrow along it."""
    user = recording.channel("ticks", "user")
    row = int(np.argmax([np.linalg.norm(user[int(tick)][1:]) for tick in moments.ticks]))
    Stage(recording, world, moments, "front", 1.0).put(row)
    return Workspace(recording, world, moments).picture(canvas, row, width, SUPERSAMPLING * HEIGHT)


def _draw_figures(recording: Recording, world: ShownWorld, moments: Timeline, canvas: Canvas, width: int) -> Image:
    """Poses side by side, turned to the camera together with their ghosts."""
    qpos, at = recording.channel("frames", "qpos"), world.figure_at
    n, half_width = len(moments.t), 0.5 * (N_POSES - 1) * POSE_SPACING
    for k, row in enumerate(np.linspace(n // 2, n - 1, N_POSES).astype(int)):
        state = qpos[int(moments.frames[row])].copy()
        pose, position = state[at : at + N_POSE].copy(), np.array([0.0, half_width - k * POSE_SPACING])
        ghost = None if moments.ghost is None else moments.ghost[row]
        state[at : at + N_POSE] = _displacement_to(pose, position).moved(pose)
        if ghost is not None:
            ghost = _displacement_to(ghost, position + GHOST_AT).moved(ghost)
        world.put(state, ghost)
        if k == 0:
            canvas.look(world.data, _VIEW, STAGE_GROUP)
        else:
            canvas.add(world.data)
    return canvas.picture(width, SUPERSAMPLING * HEIGHT)


def _displacement_to(pose: Array, position: Array) -> PlanarDisplacement:
    """The planar displacement that moves a pose to a place on the floor, facing +x."""
    yaw = float(heading(pose[3:7]))
    c, s = np.cos(-yaw), np.sin(-yaw)
    return PlanarDisplacement(
        float(position[0] - c * pose[0] + s * pose[1]), float(position[1] - s * pose[0] - c * pose[1]), -yaw
    )
