"""Reading of motion files as text within size limits, parsing of numbers, and the error for malformed files."""

import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from models.errors import ModelError

FILE_LIMIT = 64_000_000  # bytes
LINE_LIMIT = 1_000_000  # bytes
LINES_LIMIT = 5_000_000
JOINT_LIMIT = 1_000
FRAME_LIMIT = 1_000_000
VALUE_LIMIT = 8_000_000  # numbers in one file
ROTATION_LIMIT = 4_000_000  # frames × joints: 18 minutes of 31 joints at 120 frames per second
MAGNITUDE_LIMIT = 1e7  # of a length or an angle in the file's own unit

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
_COUNT = re.compile(r"[0-9]{1,12}")


class MotionFileError(ModelError):
    """A motion file that cannot be read: `file:line: what is wrong; expected what would be right`, on one line.

    Line 0 means the file as a whole; the message then has no line number.

    Attributes
    ----------
    what, expected : str
        What is wrong, and what would be right.
    """

    def __init__(self, path: Path | str, line: int, what: str, expected: str) -> None:
        where = f"{printable(str(path), 4096)}:{line}" if line else printable(str(path), 4096)
        self.what, self.expected = printable(what, 300), expected
        super().__init__(f"{where}: {self.what}; expected {expected}")


def printable(text: str, limit: int) -> str:
    """Text from a file on one line of at most `limit` characters, without terminal control characters."""
    text = "".join(character if character.isprintable() else "?" for character in text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def quoted(text: str) -> str:
    """A piece of the file for an error message: quoted, and cut when long."""
    return repr(text if len(text) <= 40 else text[:39] + "…")


def read_text(path: Path, limit: int = FILE_LIMIT, kind: str = "motion file") -> bytes:
    """A text file's content with lines ended by LF alone, from any mixture of LF, CR LF and CR; from UTF-16 as UTF-8.

    Parameters
    ----------
    path : Path
        The file.
    limit : int
        Largest size [bytes].
    kind : str
        What the file should be, for error messages.

    Raises
    ------
    MotionFileError
        If the file cannot be opened, is empty, binary, or larger than `limit` bytes or `LINES_LIMIT` lines.
    """
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise MotionFileError(path, 0, f"cannot be opened ({reason})", f"a readable {kind}") from None
    if len(content) > limit:
        raise MotionFileError(path, 0, "file is too large", f"a {kind} of at most {limit / 1e6:g} MB")
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        content = content.decode("utf-16", errors="replace").encode()
    if b"\0" in content:
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise MotionFileError(path, line, "binary content (a zero byte)", "a text file")
    if not content.strip():
        raise MotionFileError(path, 1, "file is empty", f"a {kind}")
    content = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if content.count(b"\n") > LINES_LIMIT:
        raise MotionFileError(path, LINES_LIMIT, "file goes on", f"at most {LINES_LIMIT} lines")
    return content


def numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a text file, numbered from 1, one at a time: a list of all words would take ten times the file's size.

    Raises
    ------
    MotionFileError
        If the file cannot be read as text, or a line is longer than `LINE_LIMIT`.
    """
    for index, line in enumerate(BytesIO(read_text(path))):
        if len(line) > LINE_LIMIT:
            raise MotionFileError(path, index + 1, f"line of {len(line)} bytes", f"at most {LINE_LIMIT} bytes a line")
        # Joint names come in many encodings; the numbers and keywords are ASCII in all of them.
        yield index + 1, line.decode("utf-8", errors="replace")


def number(token: str, path: Path, line: int) -> float:
    """A plain decimal number.

    Raises
    ------
    MotionFileError
        If the token is anything else (NaN, infinity, digits grouped by underscores) or beyond `MAGNITUDE_LIMIT`.
    """
    value = float(token) if _NUMBER.fullmatch(token, endpos=400) else math.nan
    if math.isnan(value):
        raise MotionFileError(path, line, f"{quoted(token)} is not a number", "a decimal number")
    if abs(value) > MAGNITUDE_LIMIT:
        raise MotionFileError(path, line, f"number {quoted(token)} is too large", f"at most {MAGNITUDE_LIMIT:.0e}")
    return value


def numbers(tokens: list[str], path: Path, line: int) -> list[float]:
    """Plain decimal numbers: a fast version of `number` for each token."""
    try:
        values = [float(token) for token in tokens]
    except ValueError:
        return [number(token, path, line) for token in tokens]
    # float() also accepts underscores, digits of other scripts, "nan" and "infinity": `number` refuses those.
    text = "".join(tokens)
    suspicious = "_" in text or "n" in text or "N" in text or not text.isascii()
    if suspicious or max(map(abs, values), default=0.0) > MAGNITUDE_LIMIT:
        return [number(token, path, line) for token in tokens]
    return values


def count(token: str, limit: int, what: str, path: Path, line: int) -> int:
    """A count from 0 to `limit`, checked before memory of that size is allocated.

    Raises
    ------
    MotionFileError
        If the token is not a count, or above the limit.
    """
    if not _COUNT.fullmatch(token) or int(token) > limit:
        raise MotionFileError(path, line, f"{what} is {quoted(token)}", f"a whole number up to {limit}")
    return int(token)


def check_size(n_frames: int, n_joints: int, n_values: int, path: Path, line: int) -> None:
    """Refuse motions without frames, or too large, before memory of that size is allocated.

    Raises
    ------
    MotionFileError
        If there are no frames or more than `FRAME_LIMIT`, `ROTATION_LIMIT` or `VALUE_LIMIT` allow.
    """
    if not 1 <= n_frames <= FRAME_LIMIT or n_frames * n_joints > ROTATION_LIMIT or n_values > VALUE_LIMIT:
        limits = f"1 to {FRAME_LIMIT} frames, {ROTATION_LIMIT} rotations and {VALUE_LIMIT} numbers at most"
        raise MotionFileError(path, line, f"{n_frames} frames of {n_joints} joints, {n_values} numbers", limits)


def frame_rate(seconds: float, path: Path, line: int) -> float:
    """Frames per second of a frame time; files round it, so a rate within 5e-5 of a whole number is that number.

    Raises
    ------
    MotionFileError
        If the time is not between 1e-5 and 1e4 s.
    """
    if not 1e-5 <= seconds <= 1e4:
        raise MotionFileError(path, line, f"frame time is {seconds:g} s", "between 0.00001 and 10000 s")
    rate = 1.0 / seconds
    return float(round(rate)) if abs(rate - round(rate)) <= 5e-5 * rate else rate
