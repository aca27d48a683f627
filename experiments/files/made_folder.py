"""A folder for results that take long to compute: whether it can be written is found out before."""

from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from sim.errors import SimError


@contextmanager
def made_folder(folder: Path) -> Generator[None]:
    """A folder that exists and can be written into; if it had to be created and stays empty, it is removed again.

    Raises
    ------
    SimError
        If it is a file.
    OSError
        If it cannot be created or written into.
    """
    if folder.exists() and not folder.is_dir():
        raise SimError(f"{folder}: is a file; expected a folder to write into")
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
        yield
    finally:
        with suppress(OSError):  # raised by a folder that was not created, or is not empty
            for path in missing:
                path.rmdir()
