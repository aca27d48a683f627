"""Haptic maps in files: a NumPy archive of what a map was made of, from which it is rebuilt to the last bit."""

import hashlib
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from controllers.errors import ControllerError
from controllers.haptic_map.composite import Composite
from controllers.haptic_map.cylindrical import Cylindrical
from controllers.haptic_map.lifted import Lifted
from geometry.arrays import Array
from geometry.whole_files import atomic_file
from models.humanoid.skeleton import N_POSE
from models.mocap.motion.clip import Clip
from sim.errors import SimError

VERSION = 1
_KINDS = {"Cylindrical": Cylindrical.from_arrays, "Composite": Composite.from_arrays, "Lifted": Lifted.from_arrays}


def save_map(haptic_map: Cylindrical | Composite | Lifted, path: Path) -> None:
    """Write a map; an existing file is replaced.

    Parameters
    ----------
    haptic_map : Cylindrical, Composite or Lifted
        Map to write.
    path : Path
        ``.npz`` file.
    """
    write_arrays(path, type(haptic_map).__name__, haptic_map.arrays())


def write_arrays(path: Path, kind: str, arrays: Mapping[str, Array]) -> None:
    """Write a map's arrays by key with its class name `kind`; an existing file is replaced, once all are written."""
    with atomic_file(path) as file:
        # Arrays are stored under numbers, as a key need not be a valid file name.
        numbered = {str(i): value for i, value in enumerate(arrays.values())}
        np.savez(
            file, allow_pickle=False, version=np.array(VERSION), kind=np.array(kind), keys=np.array(list(arrays)),
            **numbered,
        )  # fmt: skip


def load_map(path: Path) -> Cylindrical | Composite | Lifted:
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
    if kind not in _KINDS:
        raise SimError(f"{path}: holds a {kind}; expected a map: one of {', '.join(_KINDS)}")
    try:
        return _KINDS[kind](arrays)
    except ControllerError as error:
        raise SimError(f"{path}: {error}") from None


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
