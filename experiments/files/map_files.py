"""Haptic maps in files: a NumPy archive of what a map was made of, from which it is rebuilt to the last bit."""

import hashlib
from pathlib import Path

from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.lifted import Lifted
from experiments.files.archives import load_archive, write_archive
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import Clip
from sim.errors import SimError

_KINDS = {
    "Cylindrical": Cylindrical.from_arrays,
    "Composite": Composite.from_arrays,
    "Lifted": Lifted.from_arrays,
}


def save_map(haptic_map: Cylindrical | Composite | Lifted, path: Path) -> None:
    """Write a map; an existing file is replaced.

    Parameters
    ----------
    haptic_map : Cylindrical, Composite or Lifted
        Map to write.
    path : Path
        ``.npz`` file.
    """
    write_archive(path, type(haptic_map).__name__, haptic_map.arrays())


def load_map(path: Path) -> Cylindrical | Composite | Lifted:
    """Read a map that `save_map` wrote.

    Raises
    ------
    SimError
        If the file cannot be read, is of another kind, or its content does not define a map.
    """
    return load_archive(path, _KINDS, "map")


def load_figure_map(path: Path) -> tuple[Cylindrical | Composite | Lifted, tuple[Clip, ...]]:
    """Read a map of the figure, and the clips of which it was made.

    Raises
    ------
    SimError
        As `load_map`, or if its poses are not those of the figure.
    """
    haptic_map = load_map(path)
    if haptic_map.nq != N_POSE:
        raise SimError(f"{path}: its poses have {haptic_map.nq} numbers, the figure's have {N_POSE}")
    clips = zip(haptic_map.clips, haptic_map.names, strict=True)
    return haptic_map, tuple(Clip(poses, fps, name) for (poses, fps), name in clips)


def map_digest(path: Path) -> str:
    """SHA-256 of a map's file, in hexadecimal; raises OSError if it cannot be read."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
