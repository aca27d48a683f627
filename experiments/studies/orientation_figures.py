"""Pictures of gaze and lean by turning the stylus: ``python -m experiments.studies.orientation_figures docs/pictures``.

A run with turns of the stylus is made, and the response of the figure is drawn from its recording.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import matplotlib.image
import mujoco
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from controllers.state import stylus_path
from experiments.config.options import run_config
from experiments.files.figure_files import save_figure
from experiments.results.folder import RECORDING, clips_of, config_of, world_of
from experiments.results.pages.figures import AXES, STYLE
from experiments.runs.run import run
from experiments.setups.wiring import wire
from geometry.arrays import Array
from geometry.rotations import logarithm, multiply, rotate
from models.humanoid.skeleton import BODIES, N_POSE
from models.world.scene import FIGURE, world_model
from sim.recording.recording import Recording
from sim.reference.reference import map_poses

CONFIG = run_config(
    clips=("cheer",), expressive=True, user="turn", seconds=16.0, orientation_stiffness=0.05, orientation_damping=5e-4
)
BASE_COLOUR, PHYSICAL_COLOUR = "#a8adb8", "#23272f"
IMAGE_SIZE = (300, 420)  # of one picture of the figure [pixels]
DISTANCE, AZIMUTH, ELEVATION = 3.0, 205.0, -8.0  # camera in front of the figure [m], [deg], [deg]


class Bearing(NamedTuple):
    """Orientation of the figure's upper body relative to its pelvis [rad], shape (n,) each.

    Attributes
    ----------
    yaw, pitch : Array
        Angles of the gaze, the head's x axis: to the left, and down.
    lean : Array
        Lean of the chest to the right.
    """

    yaw: Array
    pitch: Array
    lean: Array


def bearing(poses: Array) -> Bearing:
    """Gaze and lean of poses (n, 75)."""
    angles = np.empty((len(poses), 3))
    for row, pose in zip(angles, poses, strict=True):
        abdomen, chest, head = (pose[3 + 4 * k : 7 + 4 * k] for k in map(BODIES.index, ("abdomen", "chest", "head")))
        trunk = multiply(*abdomen, *chest)
        ahead = rotate(*multiply(*trunk, *head), 1.0, 0.0, 0.0)
        up = rotate(*trunk, 0.0, 0.0, 1.0)
        row[:] = np.arctan2(ahead[1], ahead[0]), -np.arcsin(ahead[2]), np.arctan2(-up[1], up[2])
    return Bearing(*angles.T)


def turning_figure(recording: Recording) -> Figure:
    """Turn of the stylus, gaze and lean of the figure, and the moment of the field, over time."""
    t, frames = recording.channel("ticks", "t")[:], recording.channel("frames", "t")[:]
    turn = np.array([logarithm(*q) for q in recording.channel("ticks", "quaternion")[::8]])
    moment = recording.channel("ticks", "field")[:][:, 3:]
    animation = bearing(recording.channel("frames", "reference")[:])
    root = int(world_of(recording).joint(FIGURE + "root").qposadr[0])
    physical = bearing(recording.channel("frames", "qpos")[:][:, root : root + N_POSE])
    base = bearing(_base_poses(recording))
    figure = Figure(figsize=(9.0, 8.4), layout="constrained")
    axes = figure.subplots(5, 1, sharex=True)
    for i, name in enumerate(("roll", "pitch", "yaw")):
        axes[0].plot(t[::8], np.degrees(turn[:, i]), color=AXES[i], label=name)
        axes[4].plot(t, 1e3 * moment[:, i], color=AXES[i], label=f"about {'xyz'[i]}")
    titles = ("gaze to the left [°]", "gaze down [°]", "lean to the right [°]")
    for ax, title, k, colour in zip(axes[1:4], titles, range(3), (AXES[2], AXES[1], AXES[0]), strict=True):
        ax.plot(frames, np.degrees(base[k]), color=BASE_COLOUR, label="animation, stylus upright")
        ax.plot(frames, np.degrees(animation[k]), color=colour, label="animation")
        ax.plot(frames, np.degrees(physical[k]), color=PHYSICAL_COLOUR, ls=":", label="physical figure")
        ax.set(title=title)
    axes[0].set(title="turn of the stylus, measured [°]")
    axes[4].set(title="moment of the field, recorded but not exerted [mN m]", xlabel="time [s]")
    for ax in axes:
        # In the row of the title, where it covers no curve.
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3)
    return figure


def frames_picture(recording: Recording) -> npt.NDArray[np.uint8]:
    """Pictures of the physical figure side by side: with the stylus upright, and in each of its turns."""
    config = config_of(recording)
    lap = recording.arrays["curve_span"][1]
    moments = [0.95 * lap, *(lap * (1.25 + 0.5 * k) for k in range(6))]
    model = world_model(config.scene)
    data, root = mujoco.MjData(model), int(model.joint(FIGURE + "root").qposadr[0])
    qpos, rate = recording.channel("frames", "qpos"), recording.rates["frames"]
    camera, pictures = mujoco.MjvCamera(), list[npt.NDArray[np.uint8]]()
    camera.distance, camera.elevation = DISTANCE, ELEVATION
    with mujoco.Renderer(model, IMAGE_SIZE[1], IMAGE_SIZE[0]) as renderer:
        for moment in moments:
            data.qpos[:] = qpos[min(round(moment * rate), len(qpos) - 1)]
            mujoco.mj_forward(model, data)
            w, _, _, z = data.qpos[root + 3 : root + 7]
            camera.azimuth = AZIMUTH + np.degrees(2.0 * np.arctan2(z, w))
            camera.lookat[:] = data.qpos[root], data.qpos[root + 1], 1.05
            renderer.update_scene(data, camera)
            pictures.append(renderer.render().copy())
    return np.hstack(pictures)


def _base_poses(recording: Recording) -> Array:
    """Poses of the animation at the same positions of the stylus with the stylus upright."""
    config = config_of(recording)
    points = recording.channel("ticks", "p")[:: config.figure.figure_ticks]
    return map_poses(wire(config, clips_of(recording)).haptic_map, stylus_path(points))


def main(folder: Path) -> None:
    """Run a hand that turns the stylus, and draw what happened into a folder."""
    with tempfile.TemporaryDirectory() as scratch:
        summary = run(CONFIG, Path(scratch) / "run", False, time.perf_counter())
        with Recording(Path(scratch) / "run" / RECORDING) as recording, mpl.rc_context(STYLE):
            save_figure(turning_figure(recording), folder / "orientation.png", dpi=130)
            matplotlib.image.imsave(folder / "orientation-frames.png", frames_picture(recording))
    print(*summary.lines(), sep="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
