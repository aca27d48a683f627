"""Reader for ASF/AMC, Acclaim's pair of skeleton and motion files, in the dialect of CMU's database.

A bone's rotation is given about the bone's own axes, C = R_z R_y R_x for `axis … XYZ`: its local rotation in the file's
axes is C M C⁻¹ with M composed of the bone's degrees of freedom in the same order (Lander, *Working with motion capture
file formats*, 1998). The files state no frame rate: CMU recorded at 120 frames per second.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.readers.motion_file import (
    JOINT_LIMIT,
    MotionFileError,
    check_size,
    number,
    numbered_lines,
    numbers,
    quoted,
)
from models.mocap.readers.source_motion import SourceMotion

SKELETON_SUFFIX = ".asf"
FPS = 120.0  # [1/s], CMU's: AMC files do not state theirs
_INCH = 0.0254  # [m]
_FREEDOMS = ("tx", "ty", "tz", "rx", "ry", "rz")
_Row: TypeAlias = dict[str, list[float]]  # a frame: the values of each bone's degrees of freedom


@dataclass
class _Bone:
    """A bone while the skeleton is read; `axis` are its Euler angles in the file's unit of angle."""

    name: str
    direction: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    length: float = 0.0
    axis: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    order: str = "xyz"
    freedoms: list[str] = field(default_factory=list[str])


@dataclass
class _Skeleton:
    """An ASF file: bones by name, parents by child in the order of the joints, and units."""

    bones: dict[str, _Bone]
    parents: dict[str, str]
    position: list[float]
    degrees: bool
    length_unit: float


def read_amc(path: Path) -> SourceMotion:
    """Read an AMC file with the ASF skeleton that lies beside it.

    The skeleton of ``01_02.amc`` is ``01_02.asf``, else ``01.asf``, else the only ASF file of the folder.

    Raises
    ------
    MotionFileError
        If either file is malformed, or no skeleton is found.
    """
    skeleton = _read_asf(_skeleton_path(path))
    degrees, frames, remarks = _read_frames(path, skeleton)
    joints = ["root", *skeleton.parents]
    parents = tuple(joints.index(skeleton.parents[joint]) if joint in skeleton.parents else -1 for joint in joints)
    tips = np.array([np.multiply(skeleton.bones[joint].direction, skeleton.bones[joint].length) for joint in joints])
    offsets = np.array([tips[parent] if parent >= 0 else skeleton.position for parent in parents])
    translations = np.broadcast_to(offsets, (len(frames), *offsets.shape)).copy()
    rotations = np.zeros((len(frames), len(joints), 4))
    column = 0
    for index, joint in enumerate(joints):
        bone = skeleton.bones[joint]
        values = dict(zip(bone.freedoms, frames[:, column : column + len(bone.freedoms)].T, strict=True))
        column += len(bone.freedoms)
        axes = _euler(bone.order, dict(zip(("rx", "ry", "rz"), np.array(bone.axis), strict=True)), skeleton.degrees, 1)
        turn = _euler(bone.order, values, degrees, len(frames))
        rotations[:, index] = quaternions.product(quaternions.product(axes, turn), quaternions.conjugate(axes))
        for axis, freedom in enumerate(("tx", "ty", "tz")):
            if freedom in values:
                translations[:, index, axis] += values[freedom]
    unit = _INCH / skeleton.length_unit
    return SourceMotion(
        path, tuple(joints), parents, offsets, tips, rotations, translations, FPS, unit, timed=False, remarks=remarks
    )


def _euler(order: str, values: dict[str, Array], degrees: bool, n: int) -> Array:
    """Rotations about fixed axes, applied in the order of `order`, shape (n, 4)."""
    q = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    for letter in order:
        if (angle := values.get(f"r{letter}")) is not None:
            turn = quaternions.about_axis("xyz".index(letter), np.deg2rad(angle) if degrees else angle)
            q = quaternions.product(turn, q)
    return q


def _skeleton_path(path: Path) -> Path:
    if not path.exists():
        raise MotionFileError(path, 0, "cannot be opened (No such file or directory)", "a readable motion file")
    names = (path.with_suffix(SKELETON_SUFFIX), path.with_name(path.stem.partition("_")[0] + SKELETON_SUFFIX))
    for candidate in names:
        if candidate.is_file():
            return candidate
    others = sorted(path.parent.glob(f"*{SKELETON_SUFFIX}"))
    if len(others) == 1:
        return others[0]
    expected = " or ".join(dict.fromkeys(name.name for name in names))
    raise MotionFileError(path, 0, "its skeleton is not beside it", expected)


def _fields(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Numbered lines as words, without comments and blank lines."""
    for line, text in numbered_lines(path):
        if fields := text.partition("#")[0].split():
            yield line, fields


def _read_asf(path: Path) -> _Skeleton:
    """Parse an ASF file."""
    skeleton = _Skeleton({"root": _Bone("root")}, {}, [0.0, 0.0, 0.0], True, 1.0)
    section, bone, in_bone = "", None, False
    for line, fields in _fields(path):
        keyword = fields[0].lower()
        if keyword.startswith(":"):
            section, bone, in_bone = keyword[1:], None, False
            if section not in ("version", "name", "units", "documentation", "root", "bonedata", "hierarchy", "skin"):
                raise MotionFileError(
                    path, line, f"section {quoted(fields[0])}", ":units, :root, :bonedata, :hierarchy"
                )
        elif section == "units" and len(fields) >= 2:
            _read_unit(skeleton, keyword, fields[1], path, line)
        elif section == "root":
            _read_root_line(skeleton, fields, path, line)
        elif section == "bonedata":
            if keyword == "begin":
                bone, in_bone = None, True
            elif keyword == "end":
                in_bone = False
            elif keyword == "name" and in_bone:
                bone = _new_bone(skeleton, fields, path, line)
            elif bone is not None:
                _read_bone_line(bone, fields, path, line)
        elif section == "hierarchy" and keyword not in ("begin", "end"):
            _read_children(skeleton, fields, path, line)
    return _order_from_root(skeleton, path)


def _order_from_root(skeleton: _Skeleton, path: Path) -> _Skeleton:
    """The skeleton with every bone after its parent, whatever the order of its hierarchy's lines."""
    orphans = [name for name in skeleton.bones if name not in skeleton.parents and name != "root"]
    if orphans or not skeleton.parents:
        what = f"{quoted((orphans or ['every bone'])[0])} is not in the hierarchy"
        raise MotionFileError(path, 0, what, "a parent for every bone")
    ordered, remaining = dict[str, str](), skeleton.parents
    while remaining:
        waiting = dict[str, str]()
        for bone, parent in remaining.items():
            (ordered if parent == "root" or parent in ordered else waiting)[bone] = parent
        if len(waiting) == len(remaining):
            what = f"{quoted(next(iter(remaining)))} is below itself in the hierarchy"
            raise MotionFileError(path, 0, what, "a hierarchy that begins at the root")
        remaining = waiting
    return replace(skeleton, parents=ordered)


def _new_bone(skeleton: _Skeleton, fields: list[str], path: Path, line: int) -> _Bone:
    if len(fields) != 2 or fields[1] in skeleton.bones:
        raise MotionFileError(
            path, line, f"bone name {quoted(' '.join(fields[1:]))}", "one name, different for each bone"
        )
    if len(skeleton.bones) >= JOINT_LIMIT:
        raise MotionFileError(path, line, "too many bones", f"at most {JOINT_LIMIT}")
    skeleton.bones[fields[1]] = bone = _Bone(fields[1])
    return bone


def _read_unit(skeleton: _Skeleton, keyword: str, unit: str, path: Path, line: int) -> None:
    if keyword == "length":
        skeleton.length_unit = number(unit, path, line)
        if skeleton.length_unit <= 0.0:
            raise MotionFileError(path, line, f"unit of length is {quoted(unit)}", "a positive number")
    elif keyword == "angle":
        skeleton.degrees = unit.lower().startswith("deg")


def _read_root_line(skeleton: _Skeleton, fields: list[str], path: Path, line: int) -> None:
    root, keyword, rest = skeleton.bones["root"], fields[0].lower(), fields[1:]
    if keyword == "order":
        root.freedoms = _freedoms(rest, _FREEDOMS, path, line)
    elif keyword == "axis":
        root.order = _axis_order(rest, path, line)
    elif keyword == "position":
        skeleton.position = _vector(rest, path, line)
    elif keyword == "orientation":
        root.axis = _vector(rest, path, line)


def _read_bone_line(bone: _Bone, fields: list[str], path: Path, line: int) -> None:
    keyword, rest = fields[0].lower(), fields[1:]
    if keyword == "direction":
        bone.direction = _vector(rest, path, line)
    elif keyword == "length":
        if len(rest) != 1:
            raise MotionFileError(path, line, f"length of {len(rest)} numbers", "one number")
        bone.length = number(rest[0], path, line)
    elif keyword == "axis":
        bone.axis, bone.order = _vector(rest[:3], path, line), _axis_order(rest[3:], path, line)
    elif keyword == "dof":
        # Bones that translate or stretch are not supported; no database has any.
        bone.freedoms = _freedoms(rest, _FREEDOMS[3:], path, line)


def _vector(fields: list[str], path: Path, line: int) -> list[float]:
    if len(fields) != 3:
        raise MotionFileError(path, line, f"{len(fields)} numbers", "three numbers")
    return numbers(fields, path, line)


def _axis_order(fields: list[str], path: Path, line: int) -> str:
    order = fields[0].lower() if len(fields) == 1 else ""
    if sorted(order) != ["x", "y", "z"]:
        raise MotionFileError(path, line, f"order of axes {quoted(' '.join(fields))}", "an order such as XYZ")
    return order


def _freedoms(fields: list[str], known: tuple[str, ...], path: Path, line: int) -> list[str]:
    freedoms = [word.lower() for word in fields]
    if len(set(freedoms)) != len(freedoms) or not set(freedoms) <= set(known):
        raise MotionFileError(path, line, f"degrees of freedom {quoted(' '.join(fields))}", " ".join(known))
    return freedoms


def _read_children(skeleton: _Skeleton, fields: list[str], path: Path, line: int) -> None:
    parent = fields[0]
    if parent not in skeleton.bones:
        raise MotionFileError(path, line, f"parent {quoted(parent)}", "root, or a bone of :bonedata")
    for child in fields[1:]:
        if child == "root" or child not in skeleton.bones or child in skeleton.parents:
            raise MotionFileError(path, line, f"child {quoted(child)}", "bones of :bonedata, each with one parent")
        skeleton.parents[child] = parent


def _read_frames(path: Path, skeleton: _Skeleton) -> tuple[bool, Array, tuple[str, ...]]:
    """Whether angles are in degrees, the frames, and remarks; a frame is a row of values in the joints' order."""
    moving = {name: skeleton.bones[name] for name in ("root", *skeleton.parents) if skeleton.bones[name].freedoms}
    degrees, values = True, array("d")
    frame_numbers: list[int] = []  # the numbers of the frames
    first: _Row = {}
    row, first_line, line = first, 0, 0
    for line, fields in _fields(path):
        if fields[0].startswith(":"):
            degrees = degrees and fields[0].lower() != ":radians"
        elif len(fields) == 1:
            next_number = _frame_number(fields[0], frame_numbers, path, line)
            if frame_numbers:
                _append_frame(values, row, first, moving, path, first_line)
                row = {}
            frame_numbers.append(next_number)
            first_line = line
            check_size(len(frame_numbers), len(skeleton.bones), len(values), path, line)
        else:
            bone = moving.get(fields[0])
            if bone is None or not frame_numbers or fields[0] in row:
                raise MotionFileError(path, line, f"found {quoted(fields[0])}", "each moving bone once a frame")
            if len(fields) - 1 != len(bone.freedoms):
                what = f"{quoted(bone.name)} has {len(fields) - 1} numbers"
                raise MotionFileError(path, line, what, f"{len(bone.freedoms)}: {' '.join(bone.freedoms)}")
            row[bone.name] = numbers(fields[1:], path, line)
    if not frame_numbers:
        raise MotionFileError(path, line, "no frames", "frame numbers, each followed by its bones")
    _append_frame(values, row, first, moving, path, first_line)
    remarks = tuple(_absent_bone_remarks([name for name in moving if name not in first]))
    return degrees, np.array(values).reshape(len(frame_numbers), -1), remarks


def _absent_bone_remarks(names: list[str]) -> Iterator[str]:
    """A remark on bones that no frame mentions."""
    if names:
        listed = ", ".join(map(quoted, names[:8])) + (", …" if len(names) > 8 else "")
        has, are = ("has", "it is") if len(names) == 1 else ("have", "they are")
        yield f"{listed} {has} no values in any frame: {are} taken as unrotated"


def _frame_number(word: str, frame_numbers: list[int], path: Path, line: int) -> int:
    """The number of the frame after those numbered `frame_numbers`; raises if it jumps, since frames are lost then."""
    if not (word.isascii() and word.isdigit() and len(word) <= 12):
        raise MotionFileError(path, line, f"found {quoted(word)}", "the number of a frame")
    found = int(word)
    if frame_numbers:
        step = max((frame_numbers[1] if len(frame_numbers) > 1 else found) - frame_numbers[0], 1)
        if found != frame_numbers[-1] + step:
            expected = f"{frame_numbers[-1] + step}: frame numbers rise by a constant step"
            raise MotionFileError(path, line, f"frame {found} after frame {frame_numbers[-1]}", expected)
    return found


def _append_frame(
    values: "array[float]", row: _Row, first: _Row, moving: dict[str, _Bone], path: Path, line: int
) -> None:
    """Append the row of a frame that begins at `line`; bones (not the root) that no frame mentions have angles 0."""
    for name, bone in moving.items():
        if (name in row) != (name in first or name == "root"):
            bone_name = quoted(name)
            what = f"frame with {bone_name}, which none before it has" if name in row else f"frame without {bone_name}"
            raise MotionFileError(path, line, what, "the root and the same bones in every frame")
        values.extend(row.get(name) or [0.0] * len(bone.freedoms))
