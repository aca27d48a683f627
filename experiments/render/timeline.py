"""Timeline of a film: rows of the recording, poses of the ghost, and the path of the camera."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from experiments.render.shown_world import ShownWorld
from experiments.results.folder import DEFAULT
from geometry.arrays import Array, IntArray
from geometry.quaternions import heading
from models.mocap.library import load_clip
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.viewer.framing import view_offsets

Ghost = Literal["default", "animation", "none"]
"""Animation that the ghost shows: that of the unedited curve, that of the hand's path, or none."""

TURN_SECONDS = 4.0  # window over which the figure's heading is averaged [s]
FASTEST_TURN = 30.0  # fastest turn of the figure that the camera follows [°/s]


@dataclass(frozen=True)
class Timeline:
    """The moments of a film.

    Attributes
    ----------
    t : array (n,)
        Time in the recording [s].
    ticks, frames : array (n,)
        Rows of the recording's two groups.
    ghost : array (n, 75) or None
        Poses of the ghost.
    kind : Ghost
        Animation of the ghost.
    floor : array (n, 2)
        Path of the camera over the floor [m].
    heading : array (n,)
        Averaged heading of the figure [degrees].
    """

    t: Array
    ticks: IntArray
    frames: IntArray
    ghost: Array | None
    kind: Ghost
    floor: Array
    heading: Array


def timeline(
    recording: Recording, folder: Path, world: ShownWorld, fps: float, start: float, seconds: float | None, ghost: Ghost
) -> Timeline:
    """The moments of a film.

    Parameters
    ----------
    recording : Recording
    folder : Path
        Folder of the recording and of the default animation.
    world : ShownWorld
    fps : float
        Frame rate of the film [1/s].
    start : float
        Start of the filmed part [s].
    seconds : float or None
        Duration of the filmed part [s]; by default up to the end.
    ghost : Ghost
        Requested ghost; an interrupted run has no default animation, and shows that of the hand's path instead.

    Raises
    ------
    SimError
        If nothing was recorded at that time.
    """
    ticks_t, frames_t = (recording.channel(group, "t")[:] for group in ("ticks", "frames"))
    end = float(ticks_t[-1])
    if not 0.0 <= start < end:
        raise SimError(f"--start is {start:g} s; expected a time from 0 to {end:.3g} s, which are recorded")
    stop = end if seconds is None else min(end, start + seconds)
    t = start + np.arange(int((stop - start) * fps) + 1) / fps
    ticks, frames = (np.clip(np.searchsorted(times, t), 0, len(times) - 1) for times in (ticks_t, frames_t))
    if not world.has_figure:
        return Timeline(t, ticks, frames, None, "none", np.zeros((len(t), 2)), np.zeros(len(t)))
    qpos, at = recording.channel("frames", "qpos"), world.figure_at
    roots = np.array([qpos[int(k)][at : at + 7] for k in frames])
    path = view_offsets(roots[:, :2], fps)
    middle = np.zeros(2) if np.any(path) else np.median(roots[:, :2], axis=0)
    heading = _averaged_heading(roots[:, 3:7], fps)
    return Timeline(t, ticks, frames, *_ghost_poses(recording, folder, frames, ghost), path + middle, heading)


def _ghost_poses(recording: Recording, folder: Path, frames: IntArray, requested: Ghost) -> tuple[Array | None, Ghost]:
    """Poses of the ghost at rows of the recording's frames, and its kind."""
    if requested == "none":
        return None, requested
    file = folder / DEFAULT
    if requested == "animation" or not file.exists():
        reference = recording.channel("frames", "reference")
        return np.array([reference[int(k)] for k in frames]), "animation"
    clip = load_clip(file)
    stride = max(1, round(recording.rates["frames"] / clip.fps))
    return clip.poses[np.minimum(frames // stride, clip.n_frames - 1)], "default"


def _averaged_heading(q: Array, fps: float) -> Array:
    """Averaged heading of root rotations (n, 4) [degrees]; the initial one if it turns too fast for the camera."""
    headings = np.unwrap(heading(q))
    if len(headings) < 2:
        return np.rad2deg(headings)
    window = int(TURN_SECONDS * fps) | 1
    padded = np.pad(headings, window // 2, mode="reflect", reflect_type="odd")
    averaged = np.convolve(padded, np.full(window, 1.0 / window), mode="valid")
    if np.rad2deg(np.max(np.abs(np.diff(averaged)))) * fps > FASTEST_TURN:
        averaged = np.full(len(averaged), headings[0])
    return np.rad2deg(averaged)
