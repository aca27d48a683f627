"""Writes a film as H.264 or GIF by ffmpeg; the file gets its final name only when it is complete."""

from collections.abc import Generator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from experiments.render.graphics import Image
from sim.errors import SimError
from sim.viewer.palette import FIELD, TUBE, USER

SUFFIXES = (".mp4", ".gif")
_OPTIONS = ["-crf", "18", "-preset", "medium", "-movflags", "+faststart"]
# One palette for all frames. While it is chosen, the colours of arrows and tube are painted over a corner, so that
# thin arrows keep their colours.
_PALETTE_COLORS = "".join(
    f"drawbox=x={k}*iw/6:y=0:w=iw/6:h=ih/6:color=0x{color[1:]}:t=fill," for k, color in enumerate((FIELD, USER, TUBE))
)
_PALETTE = f"split[a][b];[a]{_PALETTE_COLORS}palettegen=max_colors=160[p];[b][p]paletteuse=dither=bayer:bayer_scale=4"


def check_target(target: Path, overwrite: bool) -> None:
    """Check that a film can be written, and does not replace a file unasked.

    Raises
    ------
    SimError
        If it cannot; the message says what is expected.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise SimError(f"{target}: films are written as {' or '.join(SUFFIXES)}; expected a name that ends so")
    if target.is_dir():
        raise SimError(f"{target}: is a folder; expected a file to write")
    if target.exists() and not overwrite:
        raise SimError(f"{target}: already exists; choose another name, or --overwrite it")


class FilmFile:
    """A film to which frames are added; an incomplete file is removed.

    Parameters
    ----------
    target : Path
        ``.mp4`` or ``.gif`` file.
    width, height : int
        Size of a frame [pixels]; even for ``.mp4``.
    fps : float
        Frames per second [1/s].

    Raises
    ------
    SimError
        If ffmpeg is not installed.
    """

    def __init__(self, target: Path, width: int, height: int, fps: float):
        self._target, self._partial_file = target, target.with_name(f".{target.stem}.part{target.suffix.lower()}")
        target.parent.mkdir(parents=True, exist_ok=True)
        self._encoder = _encoder(self._partial_file, width, height, fps)
        self._encoder.send(None)

    def add(self, frame: Image) -> None:
        """Add a frame, shape (height, width, 3)."""
        self._encoder.send(np.ascontiguousarray(frame))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if kind is None:
            self._encoder.close()
            self._partial_file.replace(self._target)
            return
        with suppress(KeyboardInterrupt):  # ffmpeg is killed before it reports a film without frames
            self._encoder.throw(KeyboardInterrupt)
        self._partial_file.unlink(missing_ok=True)


def _encoder(file: Path, width: int, height: int, fps: float) -> Generator[None, Any, None]:
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        raise SimError(
            "films are written by ffmpeg, which is not installed; expected pip install 'haptic-vector-fields[video]'"
        ) from None
    # Untyped, since its annotations forbid a fractional frame rate, and None as quality where options give it.
    write: Any = write_frames
    if file.suffix == ".gif":
        return write(
            str(file), (width, height), fps=fps, codec="gif", pix_fmt_out="pal8", quality=None, bitrate=None,
            macro_block_size=1, ffmpeg_log_level="error",  # it warns of two equal colours in the palette
            output_params=["-filter_complex", _PALETTE, "-loop", "0"],
        )  # fmt: skip
    return write(
        str(file), (width, height), fps=fps, codec="libx264", quality=None, macro_block_size=1, output_params=_OPTIONS
    )
