"""Fields in files: a bundle of rivers or an edited field as a NumPy archive, exact to the last bit."""

from pathlib import Path

from controllers.errors import ControllerError
from controllers.fields.bundle import RiverBundle
from controllers.fields.edited import Edited
from experiments.files.archives import read_archive, write_archive
from sim.errors import SimError

_KINDS = {"RiverBundle": RiverBundle, "Edited": Edited}


def save_field(field: RiverBundle | Edited, path: Path) -> None:
    """Write a field; an existing file is replaced.

    Parameters
    ----------
    field : RiverBundle or Edited
        Field to write.
    path : Path
        ``.npz`` file.
    """
    write_archive(path, type(field).__name__, field.arrays())


def load_field(path: Path) -> RiverBundle | Edited:
    """Read a field that `save_field` wrote.

    Raises
    ------
    SimError
        If the file cannot be read, is of another kind, or its content does not define a field.
    """
    kind, arrays = read_archive(path, _KINDS, "field")
    try:
        return _KINDS[kind].from_arrays(arrays)
    except ControllerError as error:
        raise SimError(f"{path}: {error}") from None
