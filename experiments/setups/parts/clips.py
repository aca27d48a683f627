"""Loading the clips of a run: embedded clips by name, others from motion files."""

from collections.abc import Sequence
from pathlib import Path

from experiments.preparation.prepared_clip import PreparedClip, prepared_clips
from models.errors import ModelError
from models.mocap.library import embedded, embedded_names
from models.mocap.motion.clip import Clip


def load_clips(names: Sequence[str], raw: bool = False, loop: str = "auto") -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """Load clips by name or file; returns them and remarks about them.

    Parameters
    ----------
    names : sequence of str
        Names of embedded clips, or paths of motion files.
    raw : bool
        Take motion files as captured; otherwise they are prepared, once for each content (`prepared_clips`).
    loop : str
        How they are prepared: ``auto``, or ``lap``.

    Raises
    ------
    ModelError
        If there is no such clip, or a file cannot be read.
    """
    for name in names:
        if name not in embedded_names() and not Path(name).suffix:
            raise ModelError(f"no embedded clip {name!r}; there are {', '.join(embedded_names())}, or give a file")
    files = iter(prepared_clips([Path(name) for name in names if name not in embedded_names()], raw, loop))
    clips = [PreparedClip(embedded(name), ()) if name in embedded_names() else next(files) for name in names]
    return tuple(each.clip for each in clips), tuple(remark for each in clips for remark in each.remarks)
