"""Formats of motion files: one table of those that are read or written, and reading of a file in any of them."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from models.mocap.readers.asf_amc import SKELETON_SUFFIX, read_amc
from models.mocap.readers.bvh import read_bvh
from models.mocap.readers.deepmimic import read_deepmimic
from models.mocap.readers.motion_file import MotionFileError, numbered_lines
from models.mocap.readers.source_motion import SourceMotion


class MotionFormat(NamedTuple):
    """A format of motion files.

    Attributes
    ----------
    name : str
        Its name.
    suffix : str
        Suffix of its files, lower case, with the dot; empty if only the content determines the format.
    read : callable or None
        Reader; None if the format is written only.
    starts : tuple of str
        What the first line that is not blank may begin with, upper case.
    addition : str
        What a person has to know besides the name to provide such a file.
    """

    name: str
    suffix: str
    read: Callable[[Path], SourceMotion] | None
    starts: tuple[str, ...] = ()
    addition: str = ""


BVH = MotionFormat("BVH", ".bvh", read_bvh, starts=("HIERARCHY",))
GLTF = MotionFormat("glTF", ".glb", None)
READABLE = (
    BVH,
    MotionFormat("AMC", ".amc", read_amc, addition=" (with its ASF beside it)"),
    MotionFormat("DeepMimic", "", read_deepmimic, starts=("{", "["), addition=" JSON"),
)
WRITABLE = (BVH, GLTF)
_TEXT_SUFFIXES = (".txt", ".json")  # suffixes that do not determine the format, as none does not
_BLENDER_SUFFIXES = (".glb", ".gltf", ".fbx")  # not read, but Blender converts them
READABLE_SUFFIXES = (*(kind.suffix for kind in READABLE if kind.suffix), *_TEXT_SUFFIXES)
UPLOADABLE_SUFFIXES = (*READABLE_SUFFIXES, SKELETON_SUFFIX)
*_FIRST, _LAST = (kind.name + kind.addition for kind in READABLE)
READABLE_NAMES = f"{', '.join(_FIRST)} or {_LAST}"
"""The readable formats, for messages."""


def read_motion(path: Path) -> SourceMotion:
    """The motion in a file on its own skeleton; the format follows from the suffix, or else from the first line.

    Raises
    ------
    MotionFileError
        If the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in ("", *_TEXT_SUFFIXES):
        start = next((text.strip() for _, text in numbered_lines(path) if text.strip()), "").upper()
        found = next((kind.read for kind in READABLE if start.startswith(kind.starts)), None)
        line, what = 1, "not a motion file"
    else:
        found = next((kind.read for kind in READABLE if suffix == kind.suffix), None)
        line, what = 0, f"{suffix} files are not read"
    if found is None:
        how = "; Blender imports it and exports BVH" if suffix in _BLENDER_SUFFIXES else ""
        raise MotionFileError(path, line, what, READABLE_NAMES + how)
    return found(path)
