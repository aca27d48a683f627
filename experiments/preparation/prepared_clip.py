"""The door for runs: a foreign motion file as a well-formed clip, prepared once and kept."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.files.kept import kept_array
from experiments.working import working
from models.mocap.clip import Clip
from models.mocap.library import load
from sim.compilation.sources import kept_folder


class PreparedClip(NamedTuple):
    """A clip for a run.

    Attributes
    ----------
    clip : Clip
        Well-formed, or as the file has it where it is on the figure's own skeleton.
    remarks : tuple of str
        What the file was taken for and what was done with it, a line each.
    """

    clip: Clip
    remarks: tuple[str, ...]


def prepared_clip(path: Path, raw: bool = False) -> PreparedClip:
    """The motion in a file, prepared; what `write_bvh` wrote is taken as it is, and so is everything if `raw`.

    Prepared clips are kept under a hash of the captured poses and of the code that prepares them.

    Raises
    ------
    ModelError
        If the file cannot be read, or contradicts itself.
    """
    loaded = load(path)
    if raw or loaded.report is None:
        return PreparedClip(loaded.clip, () if loaded.report is None else loaded.report.lines())
    from models.mocap.preparation.prepare import prepared  # brings signal processing with it

    def find() -> npt.NDArray[np.float64]:
        with working(f"preparing {path.name}"):
            made = prepared(path)
        told = np.zeros((1, made.clip.poses.shape[1]))
        told[0, :2] = made.clip.fps, made.near
        return np.vstack((told, made.clip.poses))

    made_of = (loaded.clip.poses, np.array([loaded.clip.fps, -1.0 if loaded.loops is None else float(loaded.loops)]))
    rows = kept_array(kept_folder(prepared.__module__), "prepared", made_of, (-1, loaded.clip.poses.shape[1]), find)
    clip = Clip(rows[1:], float(rows[0, 0]), loaded.clip.name)
    done = (
        "prepared" if rows[0, 1] else "no feasible motion is near it: looped and smoothed alone, as `hvf prepare` says"
    )
    return PreparedClip(clip, (*loaded.report.lines(), f"{path.name}: {done}; --raw takes the capture as it is"))
