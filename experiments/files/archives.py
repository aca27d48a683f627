"""Named arrays in a NumPy archive with the kind of its content and the version of the format."""

import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np

from controllers.errors import ControllerError
from controllers.state import Array
from experiments.files.whole_file import whole_file
from sim.errors import SimError

VERSION = 1
_WRITERS = {"map": "hvf lift", "field": "save_field"}
Content = TypeVar("Content")


def write_archive(path: Path, kind: str, arrays: Mapping[str, Array]) -> None:
    """Write arrays; an existing file is replaced, once all are written.

    Parameters
    ----------
    path : Path
        ``.npz`` file.
    kind : str
        Kind of content, such as the class name of a map.
    arrays : mapping of str to Array
        Arrays by key.
    """
    with whole_file(path) as file:
        # Arrays are stored under numbers, as a key need not be a valid file name.
        numbered = {str(i): value for i, value in enumerate(arrays.values())}
        np.savez(
            file, allow_pickle=False, version=np.array(VERSION), kind=np.array(kind), keys=np.array(list(arrays)),
            **numbered,
        )  # fmt: skip


def load_archive(path: Path, kinds: Mapping[str, Callable[[Mapping[str, Array]], Content]], what: str) -> Content:
    """Content of a file that `write_archive` wrote, rebuilt from its arrays.

    Parameters
    ----------
    path : Path
        The file.
    kinds : mapping of str to callable
        Accepted kinds of content, and the functions that rebuild them from arrays.
    what : str
        Their common name in messages.

    Raises
    ------
    SimError
        If the file cannot be read, is damaged, of another kind or version, or its content is invalid.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            version, kind = int(archive["version"]), str(archive["kind"])
            arrays: dict[str, Array] = {str(key): archive[str(i)] for i, key in enumerate(archive["keys"])}
    except OSError as error:
        raise SimError(f"{path}: cannot be read ({error.strerror}); expected the .npz file of a {what}") from None
    except (ValueError, TypeError, KeyError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error):
        raise SimError(f"{path}: is no file of a {what}, or damaged; expected what {_WRITERS[what]} writes") from None
    if version != VERSION:
        raise SimError(f"{path}: is of version {version} of the format, this program reads {VERSION}; make it again")
    if kind not in kinds:
        raise SimError(f"{path}: holds a {kind}; expected a {what}: one of {', '.join(kinds)}")
    try:
        return kinds[kind](arrays)
    except ControllerError as error:
        raise SimError(f"{path}: {error}") from None
