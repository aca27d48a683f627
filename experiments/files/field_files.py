"""Fields in files: a bundle of rivers or an edited field as a NumPy archive, exact to the last bit."""

from pathlib import Path

from controllers.fields.bundle import RiverBundle
from controllers.fields.edited import Edited
from experiments.files.archives import load_archive, write_archive

_KINDS = {"RiverBundle": RiverBundle.from_arrays, "Edited": Edited.from_arrays}


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
    return load_archive(path, _KINDS, "field")
