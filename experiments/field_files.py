"""Fields in files: a bundle of rivers or an edited field as a NumPy archive, exact to the last bit."""

import zipfile
from pathlib import Path

import numpy as np

from controllers.errors import ControllerError
from controllers.fields.bundle import RiverBundle
from controllers.fields.edited import Edited
from controllers.state import Array
from sim.errors import SimError

_KINDS = {"RiverBundle": RiverBundle, "Edited": Edited}


def save_field(field: RiverBundle | Edited, path: Path) -> None:
    """Write a field; an existing file is replaced.

    Parameters
    ----------
    field : RiverBundle or Edited
        What to keep.
    path : Path
        ``.npz`` file.
    """
    kind = np.array(type(field).__name__)
    with path.open("wb") as file:
        # Keys are numbered, for a name of a river may be no name of a file.
        arrays = field.arrays()
        numbered = {str(i): value for i, value in enumerate(arrays.values())}
        np.savez(file, allow_pickle=False, kind=kind, keys=np.array(list(arrays)), **numbered)


def load_field(path: Path) -> RiverBundle | Edited:
    """Field of a file that `save_field` wrote.

    Raises
    ------
    SimError
        If the file is none of these, or what it holds makes no field.
    OSError
        If it cannot be read.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            kind = str(archive["kind"])
            arrays: dict[str, Array] = {str(key): archive[str(i)] for i, key in enumerate(archive["keys"])}
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise SimError(f"{path}: is no file of a field ({error}); expected one that save_field wrote") from None
    if kind not in _KINDS:
        raise SimError(f"{path}: holds a {kind}; expected one of {', '.join(_KINDS)}")
    try:
        return _KINDS[kind].from_arrays(arrays)
    except ControllerError as error:
        raise SimError(f"{path}: {error}") from None
