"""Reader for BVH files of any program."""

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geometry import quaternions
from geometry.arrays import Array
from models.mocap.readers.motion_file import (
    FRAME_LIMIT,
    JOINT_LIMIT,
    MotionFileError,
    check_size,
    count,
    frame_rate,
    number,
    numbered_lines,
    numbers,
    quoted,
)
from models.mocap.readers.source_motion import MAX_GAP_TIME, SourceMotion

_MAX_ZERO_RATIO = 1e-3  # largest displacement of a joint, as a fraction of its OFFSET, that counts as zero
# Median relative difference of bones from the lengths of their OFFSETs: above the first value, positions are not given
# from the parent; below the second, if they are read as positions in the world, they are that. The differences are 4.6
# to 8.4 and 0.03 to 0.16 in 19 captures of one laboratory; in some 300 others the first is at most 0.1, except in one,
# where the second is 14.
_MIN_PARENT_MISFIT, _MAX_WORLD_MISFIT = 1.0, 0.5
_FULL_TURN = 2.0 * np.pi + 1e-3  # [rad]; in degrees no angle of any of 150 captures is as small
_RADIANS_REMARK = (
    "no rotation in the file exceeds 6.3: BVH has degrees, in which this body hardly moves; if these are radians, "
    "multiply them by 57.3"
)
_NAN = re.compile(r"(?<!\S)[+-]?nan(?!\S)", re.IGNORECASE)
_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)


@dataclass
class _Joint:
    """A joint while its block is read; positions and rotations list pairs (axis, column of the frame's line)."""

    name: str
    parent: int
    line: int
    offset: list[float] | None = None
    tips: list[list[float]] = field(default_factory=list[list[float]])
    positions: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    rotations: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])


def read_bvh(path: Path) -> SourceMotion:
    """Read a BVH file.

    Position channels of any joint replace its OFFSET, unless they are displacements from it (`_has_displacements`) or
    positions in the world (`_from_world_positions`); each joint may have its own channels in its own order.

    Raises
    ------
    MotionFileError
        If the file is not a BVH, is truncated, or its counts do not agree.
    """
    lines = numbered_lines(path)
    joints, n_columns = _read_hierarchy(lines, path)
    frames, fps, remarks = _read_frames(lines, len(joints), n_columns, path)
    offsets = np.array([joint.offset for joint in joints], dtype=np.float64)
    tips = np.array([joint.tips[0] if joint.tips else (0.0, 0.0, 0.0) for joint in joints], dtype=np.float64)
    further = {k: np.array(joint.tips[1:]) for k, joint in enumerate(joints) if len(joint.tips) > 1}
    translations = np.broadcast_to(offsets, (len(frames), *offsets.shape)).copy()
    rotations = np.zeros((len(frames), len(joints), 4))
    rotations[..., 0] = 1.0
    turns = np.abs(frames[:, [column for joint in joints for _, column in joint.rotations]])
    if len(frames) > 1 and 0.0 < turns.max(initial=0.0) <= _FULL_TURN:
        remarks = (*remarks, _RADIANS_REMARK)
    displaced = _has_displacements(joints, frames)
    for index, joint in enumerate(joints):
        for axis, column in joint.positions:
            start = offsets[index, axis] if displaced and index else 0.0
            translations[:, index, axis] = start + frames[:, column]
        for axis, column in joint.rotations:
            turn = quaternions.about_axis(axis, np.deg2rad(frames[:, column]))
            rotations[:, index] = quaternions.product(rotations[:, index], turn)
    names, parents = tuple(joint.name for joint in joints), tuple(joint.parent for joint in joints)
    placed = [k for k, joint in enumerate(joints) if k and len(joint.positions) == 3 and offsets[k].any()]
    # A frame of zeros is a lost frame: its joints are placed as in a file without position channels.
    lost = np.flatnonzero(~translations[:, placed].any(axis=(1, 2)))
    for k in placed:
        translations[lost, k] = offsets[k]
    if placed and not displaced and _length_misfit(translations, offsets, placed) > _MIN_PARENT_MISFIT:
        local = _from_world_positions(translations, rotations, parents, placed)
        if _length_misfit(local, offsets, placed) < _MAX_WORLD_MISFIT:
            translations = local
            listed = ", ".join(names[k] for k in placed)
            remarks = (
                *remarks,
                f"the positions of {listed} are given in the world, not relative to their parents: read so",
            )
    return SourceMotion(
        path, names, parents, offsets, tips, rotations, translations, fps, None, remarks=remarks, further_tips=further
    )


def _has_displacements(joints: list[_Joint], frames: Array) -> bool:
    """Whether position channels below the root are displacements from OFFSET.

    Most programs write the position itself, which is as far from the parent as OFFSET is. MakeHuman writes zeros.
    """
    are_zero: list[bool] = []
    for joint in joints[1:]:
        length = float(np.linalg.norm(joint.offset or ()))
        if len(joint.positions) == 3 and length > 0.0:
            places = frames[:, [column for _, column in joint.positions]]
            are_zero.append(bool(np.abs(places).max() < _MAX_ZERO_RATIO * length))
    return sum(are_zero) > len(are_zero) / 2


def _length_misfit(translations: Array, offsets: Array, placed: list[int]) -> float:
    """Median relative difference of bones from the lengths of their OFFSETs."""
    lengths = np.linalg.norm(offsets[placed], axis=-1)
    return float(np.median(np.abs(np.linalg.norm(translations[:, placed], axis=-1) - lengths) / lengths))


def _from_world_positions(translations: Array, rotations: Array, parents: tuple[int, ...], placed: list[int]) -> Array:
    """Translations in the parents' axes, if those of the joints `placed` are positions in the world."""
    local, orientations, places = translations.copy(), rotations.copy(), translations.copy()
    for k, parent in enumerate(parents):
        if parent < 0:
            continue
        orientations[:, k] = quaternions.product(orientations[:, parent], rotations[:, k])
        if k in placed:
            vector = places[:, k] - places[:, parent]
            local[:, k] = quaternions.rotated(quaternions.conjugate(orientations[:, parent]), vector)
        else:
            places[:, k] = places[:, parent] + quaternions.rotated(orientations[:, parent], translations[:, k])
    return local


class _Tokens:
    """Words of the hierarchy, with the line of the last one."""

    def __init__(self, lines: Iterator[tuple[int, str]], path: Path) -> None:
        self.path = path
        self.line = 0
        self._words = ((number, word) for number, line in lines for word in line.split())

    def next(self, expected: str) -> str:
        """The next word."""
        line, word = next(self._words, (self.line, ""))
        if not word:
            raise MotionFileError(self.path, line, "file ends in the hierarchy", expected)
        self.line = line
        return word

    def name(self) -> str:
        """Words up to the opening brace: names such as `Bip01 L Thigh` contain blanks."""
        words: list[str] = []
        while (word := self.next("a name and {")) != "{":
            words.append(word)
            if len(words) > 8 or len(word) > 200:
                raise MotionFileError(
                    self.path, self.line, f"name {quoted(' '.join(words))} does not end", "a { after it"
                )
        return " ".join(words)

    def joint(self, parent: int, index: int) -> _Joint:
        """A new joint, after the word ROOT or JOINT was read."""
        line = self.line
        if index >= JOINT_LIMIT:
            raise self.error("too many joints", f"at most {JOINT_LIMIT}")
        if not (name := self.name()):
            raise MotionFileError(self.path, line, "joint without a name", "a name after ROOT or JOINT")
        return _Joint(name, parent, line)

    def vector(self) -> list[float]:
        """Three numbers."""
        return [number(self.next("three numbers"), self.path, self.line) for _ in range(3)]

    def error(self, what: str, expected: str) -> MotionFileError:
        """An error at the last word."""
        return MotionFileError(self.path, self.line, what, expected)


def _read_hierarchy(lines: Iterator[tuple[int, str]], path: Path) -> tuple[list[_Joint], int]:
    """Joints in the file's order and number of channels; leaves the lines after MOTION."""
    tokens = _Tokens(lines, path)
    if (word := tokens.next("HIERARCHY")).upper() != "HIERARCHY":
        raise tokens.error(f"file begins with {quoted(word)}", "HIERARCHY: is this a BVH file?")
    if (word := tokens.next("ROOT")).upper() != "ROOT":
        raise tokens.error(f"found {quoted(word)}", "ROOT")
    joints = [tokens.joint(-1, 0)]
    open_joints, n_columns = [0], 0
    while open_joints:
        joint = joints[open_joints[-1]]
        word = tokens.next("}")
        keyword = word.upper()
        if keyword == "OFFSET":
            joint.offset = tokens.vector()
        elif keyword == "CHANNELS":
            n_columns = _read_channels(tokens, joint, n_columns)
        elif keyword == "JOINT":
            joints.append(tokens.joint(open_joints[-1], len(joints)))
            open_joints.append(len(joints) - 1)
        elif keyword == "END":
            joint.tips.append(_read_end_site(tokens))
        elif word == "}":
            open_joints.pop()
            if joint.offset is None:
                raise tokens.error(f"joint {quoted(joint.name)} (line {joint.line}) has no OFFSET", "OFFSET x y z")
        else:
            raise tokens.error(f"found {quoted(word)}", "OFFSET, CHANNELS, JOINT, End Site or }")
    if (word := tokens.next("MOTION")).upper() == "ROOT":
        raise tokens.error("a second ROOT, as of another person", "one skeleton, of one person, in a file")
    if word.upper() != "MOTION":
        raise tokens.error(f"found {quoted(word)} after the root's }}", "MOTION")
    return joints, n_columns


def _read_channels(tokens: _Tokens, joint: _Joint, column: int) -> int:
    """Record which columns drive which axes of a joint; returns the next free column."""
    if joint.positions or joint.rotations:
        raise tokens.error(f"joint {quoted(joint.name)} has CHANNELS twice", "one line of CHANNELS a joint")
    for _ in range(count(tokens.next("a number of channels"), 6, "number of channels", tokens.path, tokens.line)):
        word = tokens.next("a channel such as Xrotation")
        match = _CHANNEL.fullmatch(word)
        if match is None:
            raise tokens.error(f"channel {quoted(word)}", "Xposition … Zposition, Xrotation … Zrotation")
        channels = joint.positions if match[2].lower() == "position" else joint.rotations
        axis = "xyz".index(match[1].lower())
        if channels is joint.positions and axis in dict(channels):
            raise tokens.error(f"channel {quoted(word)} stands twice in one joint", "each position once")
        channels.append((axis, column))
        column += 1
    return column


def _read_end_site(tokens: _Tokens) -> list[float]:
    tokens.name()
    tip = [0.0, 0.0, 0.0]
    while (word := tokens.next("OFFSET or }")) != "}":
        if word.upper() != "OFFSET":
            raise tokens.error(f"found {quoted(word)} in an End Site", "OFFSET or }")
        tip = tokens.vector()
    return tip


def _read_frames(
    lines: Iterator[tuple[int, str]], n_joints: int, n_columns: int, path: Path
) -> tuple[Array, float, tuple[str, ...]]:
    """The frames' channels, shape (frames, channels), their rate, and remarks on frames that are lost or not declared.

    A frame that lost numbers (``nan``) repeats the one before; `repeated_frames` interpolates it.

    Exporters miscount by one, or write a reference pose in front that they do not count. The file does not say which
    frame is the extra one, so all are read. More lines than that mean a damaged file.
    """
    rest = ((line, text) for line, text in lines if text.strip())
    line, text = next(rest, (0, ""))
    match = re.fullmatch(r"\s*Frames\s*:\s*(\S+)\s*", text, re.IGNORECASE)
    if match is None:
        raise MotionFileError(path, line, f"found {quoted(text.strip())} after MOTION", "Frames: n")
    n_frames = count(match[1], FRAME_LIMIT, "number of frames", path, line)
    check_size(n_frames, n_joints, n_frames * n_columns, path, line)
    line, text = next(rest, (line + 1, ""))
    match = re.fullmatch(r"\s*Frames?\s+Time\s*:\s*(\S+)\s*", text, re.IGNORECASE)
    if match is None:
        raise MotionFileError(path, line, f"found {quoted(text.strip())} after Frames", "Frame Time: seconds")
    fps = frame_rate(number(match[1], path, line), path, line)
    values, found, lost = array("d"), 0, _Lost(max(1, int(MAX_GAP_TIME * fps)))
    for line, text in rest:
        tokens = text.split()
        found += 1
        if found > n_frames + 1 or (found > n_frames and len(tokens) != n_columns):
            what = f"more lines than the {_frame_count_text(n_frames)} declared"
            raise MotionFileError(path, line, what, "as many as Frames says")
        if len(tokens) != n_columns:
            raise MotionFileError(path, line, f"frame of {len(tokens)} numbers", f"{n_columns}, one a channel")
        values.extend(values[-n_columns:] if lost.follows(text, found, line) else numbers(tokens, path, line))
    # The frames of a skeleton without channels are empty lines, which are skipped.
    if found < n_frames and n_columns:
        raise MotionFileError(path, line, f"file ends after {found} of {n_frames} frames", f"{n_frames} lines")
    note = (
        f"the file has {_frame_count_text(found)}, one more than the {n_frames} it declares: the last one is read, too"
    )
    frames = np.array(values).reshape(max(found, n_frames), n_columns)
    return frames, fps, (*((note,) if found > n_frames else ()), *lost.remarks())


class _Lost:
    """Frames without some number, written as nan, of which at most `longest` in a row repeat the one before."""

    def __init__(self, longest: int) -> None:
        self.longest, self.frames = longest, dict[int, int]()  # their lines, by frame

    def follows(self, text: str, frame: int, line: int) -> bool:
        """Whether a frame, with this text in this line, is lost and can repeat the one before."""
        if frame < 2 or _NAN.search(text) is None:
            return False
        if all(frame - k in self.frames for k in range(1, self.longest + 1)):
            return False
        self.frames[frame] = line
        return True

    def remarks(self) -> tuple[str, ...]:
        """A line that names the first one."""
        if not self.frames:
            return ()
        first, n = min(self.frames.values()), len(self.frames)
        return (f"{_frame_count_text(n)} {'lacks' if n == 1 else 'lack'} numbers (nan), the first in line {first}",)


def _frame_count_text(n: int) -> str:
    return f"{n} frame{'s' * (n != 1)}"
