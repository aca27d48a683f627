"""``hvf report``: page and figures of a run, drawn again; of a run that was stopped, all that it would have left."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.working import working


@dataclass(frozen=True)
class Command:
    """Draw the figures and the page of a run again; of a run that was stopped, also write summary and animations."""

    folder: Positional[Path]
    """Folder of a run."""

    def __call__(self) -> int:
        """Draw."""
        from experiments.finish import finish

        with working("drawing the report"):
            lines = finish(self.folder)
        print("\n".join([*lines, f"Written: {self.folder / 'report.html'}; open it in a browser."]))
        return 0
