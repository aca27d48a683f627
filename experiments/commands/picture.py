"""``hvf picture``: a run as a PNG file."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.console.progress import working


@dataclass(frozen=True)
class Command:
    """Render the Phantom and the figure of a run into a PNG file."""

    folder: Positional[Path]
    """Folder of a run."""
    target: Positional[Path]
    """PNG file to write."""
    overwrite: bool = False
    """Replace the target if it exists."""

    def __call__(self) -> int:
        """Render."""
        from experiments.render.picture import draw_picture

        with working("drawing"):
            draw_picture(self.folder, self.target, self.overwrite)
        return 0
