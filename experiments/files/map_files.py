"""Lifted maps in files: a NumPy archive of what a map was made of, from which it is rebuilt to the last bit."""

import hashlib
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from controllers.errors import ControllerError
from controllers.haptic_map.lifted import Lifted
from geometry.arrays import Array
from geometry.whole_files import atomic_file
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import Clip
from sim.errors import SimError

VERSION, KIND = 1, "Lifted"


def save_map(haptic_map: Lifted, path: Path) -> None:
    """Write a map; an existing file is replaced.

    Parameters
    ----------
    haptic_map : Lifted
        Map to write.
    path : Path
        ``.npz`` file.
    """
    write_arrays(path, haptic_map.arrays())


def write_arrays(path: Path, arrays: Mapping[str, Array]) -> None:
    """Write a map's arrays by key; an existing file is replaced, once all are written."""
    with atomic_file(path) as file:
        # Arrays are stored under numbers, as a key need not be a valid file name.
        numbered = {str(i): value for i, value in enumerate(arrays.values())}
        np.savez(
            file, allow_pickle=False, version=np.array(VERSION), kind=np.array(KIND), keys=np.array(list(arrays)),
            **numbered,
        )  # fmt: skip


def load_map(path: Path) -> Lifted:
    """Read a map that `save_map` wrote.

    Raises
    ------
    SimError
        If the file cannot be read, is damaged, of another kind or version, or its content does not define a map.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            version, kind = int(archive["version"]), str(archive["kind"])
            arrays: dict[str, Array] = {str(key): archive[str(i)] for i, key in enumerate(archive["keys"])}
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected the .npz file of a map") from None
    except (ValueError, TypeError, KeyError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error):
        raise SimError(f"{path}: is not a map file, or damaged; expected what hvf lift writes") from None
    if version != VERSION:
        raise SimError(f"{path}: is of version {version} of the format, this program reads {VERSION}; make it again")
    if kind != KIND:
        raise SimError(f"{path}: holds a map of kind {kind!r}; expected what hvf lift writes")
    try:
        return Lifted.from_arrays(arrays)
    except ControllerError as error:
        raise SimError(f"{path}: {error}") from None


def load_figure_map(path: Path) -> tuple[Lifted, tuple[Clip, ...]]:
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
