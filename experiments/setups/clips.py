"""Clips of a run: embedded ones by name, others from files."""

from collections.abc import Sequence
from pathlib import Path

from controllers.errors import ParameterError
from models.errors import ModelError
from models.mocap.clip import Clip
from models.mocap.library import embedded, embedded_names, load


def load_clips(names: Sequence[str]) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """Clips by name or file, and what has to be said about them.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    clips: list[Clip] = []
    remarks: list[str] = []
    for name in names:
        if name in embedded_names():
            clips.append(embedded(name))
        elif not Path(name).suffix:
            raise ModelError(f"no embedded clip {name!r}; there are {', '.join(embedded_names())}, or give a file")
        else:
            loaded = load(Path(name))
            clips.append(loaded.clip)
            remarks += [] if loaded.report is None else loaded.report.lines()
    return tuple(clips), tuple(remarks)


def only(clips: tuple[Clip, ...]) -> Clip:
    """The one clip of a run that takes one.

    Raises
    ------
    ParameterError
        If there are more, or none.
    """
    if len(clips) != 1:
        raise ParameterError(f"one clip is led, got {len(clips)}; name one with --clips, such as walk or run")
    return clips[0]
