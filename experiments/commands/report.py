"""``hvf report``: page and figures of a run, drawn again; an interrupted run is completed first."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from experiments.console.output import Json, say
from experiments.console.progress import working
from experiments.results.folder import REPORT


@dataclass(frozen=True)
class Command:
    """Draw the figures and the page of a run again; for a run that was stopped, also write summary and animations."""

    folder: Positional[Path]
    """Folder of a run."""
    json: Json = False

    def __call__(self) -> int:
        """Draw."""
        from experiments.runs.finish import finish

        with working("drawing the report"):
            lines = finish(self.folder)
        page = str(self.folder / REPORT)
        lines_and_page = [*lines, f"Written: {page}; open it in a browser."]
        say({"lines": lines, "report": page}, self.json, lines_and_page)
        return 0
