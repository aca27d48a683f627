"""Reader for DeepMimic's JSON motions: rows of duration, root position, and quaternions wxyz or hinge angles.

The skeleton is in a character file, ``NAME_character.txt`` beside ``NAME_motion.txt``; without one it is
DeepMimic's own humanoid (metres, Y up, facing +X, arms hanging). A hinge turns about z (Peng et al. 2018,
github.com/xbpeng/DeepMimic).
"""

import json
import re
from pathlib import Path
from typing import NamedTuple, NoReturn, cast

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.readers.motion_file import (
    JOINT_LIMIT,
    MAGNITUDE_LIMIT,
    MotionFileError,
    check_size,
    frame_rate,
    quoted,
    read_text,
)
from models.mocap.readers.source_motion import SourceMotion

_VALUE_COUNTS = {"none": 7, "spherical": 4, "revolute": 1, "fixed": 0}
_JSON_LIMIT = 16_000_000  # bytes: parsed, a malicious file takes some thirty times its size


class _Joint(NamedTuple):
    """A joint of a character; `attach` is its position in the parent's frame [m]."""

    name: str
    kind: str
    parent: int
    attach: tuple[float, float, float]


def _limbs(side: str, first: int, out: float) -> tuple[_Joint, ...]:
    return (
        _Joint(f"{side}_hip", "spherical", 0, (0.0, 0.0, 0.084887 * out)),
        _Joint(f"{side}_knee", "revolute", first, (0.0, -0.421546, 0.0)),
        _Joint(f"{side}_ankle", "spherical", first + 1, (0.0, -0.40987, 0.0)),
        _Joint(f"{side}_shoulder", "spherical", 1, (-0.02405, 0.2435, 0.18311 * out)),
        _Joint(f"{side}_elbow", "revolute", first + 3, (0.0, -0.274788, 0.0)),
        _Joint(f"{side}_wrist", "fixed", first + 4, (0.0, -0.258947, 0.0)),
    )


_HUMANOID = (
    _Joint("root", "none", -1, (0.0, 0.0, 0.0)),
    _Joint("chest", "spherical", 0, (0.0, 0.236151, 0.0)),
    _Joint("neck", "spherical", 1, (0.0, 0.223894, 0.0)),
    *_limbs("right", 3, 1.0),
    *_limbs("left", 9, -1.0),
)


def read_deepmimic(path: Path) -> SourceMotion:
    """Read a DeepMimic motion.

    Rows of unequal duration are resampled to the shortest one.

    Raises
    ------
    MotionFileError
        If the motion or its character file is malformed.
    """
    text, document = _parse(path)
    character = path.with_name(path.stem.partition("_")[0] + "_character.txt")
    joints = _read_character(character) if character.is_file() and character != path else _HUMANOID
    durations, rows = _read_rows(text, document, joints, path)
    offsets = np.array([joint.attach for joint in joints])
    translations = np.broadcast_to(offsets, (len(rows), *offsets.shape)).copy()
    translations[:, 0] += rows[:, 1:4]
    rotations, column = np.empty((len(rows), len(joints), 4)), 4
    for index, joint in enumerate(joints):
        if joint.kind == "fixed":
            rotations[:, index] = (1.0, 0.0, 0.0, 0.0)
        elif joint.kind == "revolute":
            rotations[:, index] = quaternions.about_axis(2, rows[:, column])
            column += 1
        else:
            rotations[:, index] = rows[:, column : column + 4]
            column += 4
    norms = np.linalg.norm(rotations, axis=2, keepdims=True)
    if norms.min() < 0.1:
        frame = int(np.argmin(norms.min(axis=(1, 2))))
        raise MotionFileError(path, _line_of_row(text, frame), "a quaternion is near zero", "unit quaternions")
    rotations = quaternions.sign_continuous(rotations / norms)
    translations, rotations, fps = _resample(durations, translations, rotations, path)
    names, parents = tuple(joint.name for joint in joints), tuple(joint.parent for joint in joints)
    loop = document.get("Loop")
    loops = loop == "wrap" if isinstance(loop, str) else None
    return SourceMotion(
        path, names, parents, offsets, np.zeros_like(offsets), rotations, translations, fps, 1.0, "+Y", loops
    )


def _parse(path: Path) -> tuple[str, dict[str, object]]:
    """The file's text and its outermost object."""

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number")

    text = read_text(path, _JSON_LIMIT).decode("utf-8", errors="replace")
    try:
        document: object = json.loads(text, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise MotionFileError(path, error.lineno, f"JSON: {error.msg}", "a JSON object with Frames") from None
    except RecursionError:
        raise MotionFileError(path, 1, "JSON is nested too deeply", "Frames: a list of lists of numbers") from None
    except ValueError as error:
        raise MotionFileError(path, 1, f"JSON: {error}", "finite numbers") from None
    if not isinstance(document, dict):
        raise MotionFileError(path, 1, "JSON is not an object", '{"Frames": [[…], …]}')
    return text, cast("dict[str, object]", document)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= MAGNITUDE_LIMIT


def _line_of_row(text: str, row: int) -> int:
    """The line on which a row of Frames begins: that of the (row + 2)-nd opening bracket."""
    start = re.search(r'"Frames"\s*:', text)
    place = start.end() if start else 0
    for _ in range(row + 2):
        place = text.find("[", place) + 1 or len(text)
    return text.count("\n", 0, place) + 1


def _read_rows(text: str, document: dict[str, object], joints: tuple[_Joint, ...], path: Path) -> tuple[Array, Array]:
    """Durations [s], shape (rows,), and all the numbers, shape (rows, width)."""
    width = 1 + sum(_VALUE_COUNTS[joint.kind] for joint in joints)
    if not isinstance(rows := document.get("Frames"), list) or not rows:
        raise MotionFileError(path, 1, "no list of Frames", '"Frames": [[duration, x, y, z, …], …]')
    rows = cast("list[object]", rows)
    check_size(len(rows), len(joints), len(rows) * width, path, 1)
    for index, row in enumerate(rows):
        values = cast("list[object]", row) if isinstance(row, list) else []
        if len(values) != width:
            what = f"frame {index} has {len(values)} values"
        elif not all(_is_number(value) for value in values):
            what = f"frame {index} has a value that is no number or too large"
        else:
            continue
        raise MotionFileError(path, _line_of_row(text, index), what, f"{width} numbers below {MAGNITUDE_LIMIT:.0e}")
    table = np.array(rows, dtype=np.float64)
    if table[:, 0].min() < 0.0:
        index = int(np.argmin(table[:, 0]))
        raise MotionFileError(path, _line_of_row(text, index), "negative duration", "seconds until the next frame")
    return table[:, 0], table


def _resample(durations: Array, translations: Array, rotations: Array, path: Path) -> tuple[Array, Array, float]:
    """Translations, rotations and rate resampled to equal steps; the last row's duration is not used."""
    steps = durations[:-1]
    if len(steps) == 0:
        # A single pose has no rate; DeepMimic plays at 30.
        return translations, rotations, 30.0
    fps = frame_rate(float(steps.min()), path, 1)
    if np.ptp(steps) <= 1e-4 * steps.min():
        return translations, rotations, fps
    times = np.append(0.0, np.cumsum(steps))
    n_frames = int(times[-1] * fps + 1e-6) + 1
    check_size(n_frames, rotations.shape[1], n_frames, path, 1)
    new_times = np.arange(n_frames) / fps
    before = np.clip(np.searchsorted(times, new_times, side="right") - 1, 0, len(steps) - 1)
    fraction = ((new_times - times[before]) / steps[before])[:, None, None]
    translations = (1.0 - fraction) * translations[before] + fraction * translations[before + 1]
    rotations = (1.0 - fraction) * rotations[before] + fraction * rotations[before + 1]
    return translations, rotations / np.linalg.norm(rotations, axis=2, keepdims=True), fps


def _read_character(path: Path) -> tuple[_Joint, ...]:
    """Joints of a character file, the first one the root."""
    _, document = _parse(path)
    skeleton = document.get("Skeleton")
    entries = cast("dict[str, object]", skeleton).get("Joints") if isinstance(skeleton, dict) else None
    if not isinstance(entries, list) or not 1 <= len(cast("list[object]", entries)) <= JOINT_LIMIT:
        raise MotionFileError(path, 1, "no list of joints", f'"Skeleton": {{"Joints": […]}}, at most {JOINT_LIMIT}')
    joints: list[_Joint] = []
    for index, item in enumerate(cast("list[object]", entries)):
        entry = cast("dict[str, object]", item) if isinstance(item, dict) else {}
        name, kind, parent = entry.get("Name"), entry.get("Type"), entry.get("Parent")
        attach = tuple(entry.get(f"Attach{axis}", 0.0) for axis in "XYZ")
        if not isinstance(name, str) or not isinstance(kind, str) or kind not in _VALUE_COUNTS:
            what = f"joint {index} has Name {quoted(str(name))} and Type {quoted(str(kind))}"
            raise MotionFileError(path, 1, what, f"a name and one of {', '.join(_VALUE_COUNTS)}")
        if (
            type(parent) is not int
            or not (-1 if index == 0 else 0) <= parent < index
            or not all(_is_number(value) for value in attach)
        ):
            raise MotionFileError(path, 1, f"joint {quoted(name)}: Parent or Attach", "an earlier joint and numbers")
        if (kind == "none") != (index == 0):
            raise MotionFileError(path, 1, f"joint {quoted(name)} is of type {kind}", "type none for the root alone")
        x, y, z = cast("tuple[float, float, float]", attach)
        joints.append(_Joint(name, kind, parent, (float(x), float(y), float(z))))
    return tuple(joints)
