"""``hvf render``: a film of a run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from experiments.console.output import Json, say


@dataclass(frozen=True)
class Command:
    """Film a run from its recording: the workspace with its forces beside the figure and the default animation."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of a run."""
    out: Path | None = None
    """Film to write, .mp4 or .gif; film.mp4 in the run's folder by default."""
    gif: bool = False
    """Write a GIF beside it as well, half as large, every second frame."""
    show: Literal["both", "workspace", "stage"] = "both"
    """What to show."""
    camera: Literal["three-quarter", "front", "side", "back", "above"] = "three-quarter"
    """Camera position relative to where the figure faces."""
    ghost: Literal["default", "animation", "none"] = "default"
    """What to show beside the figure: the curve's own animation, that of the hand's path, or nothing."""
    start: float = 0.0
    """Time in the run at which the film starts [s]."""
    seconds: float | None = None
    """Duration of the film [s]; by default to the end."""
    width: int = 1280
    """Of a frame [pixels]."""
    height: int = 720
    """Of a frame [pixels]."""
    fps: float = 30.0
    """Frames per second [Hz]."""
    overwrite: bool = False
    """Replace the film if it exists."""
    json: Json = False

    def __call__(self) -> int:
        """Render."""
        from experiments.render.film import Film, render
        from experiments.results.folder import FILM

        film = Film(self.show, self.camera, self.ghost, self.start, self.seconds, self.width, self.height, self.fps)
        say(render(self.folder, self.out or self.folder / FILM, film, self.gif, self.overwrite), self.json)
        return 0
