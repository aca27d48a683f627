"""``hvf figures``: the figures of the paper, drawn from runs."""

import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Command:
    """Draw Figures 1 to 8 of the paper from runs of this program, as PDF and PNG with a page of them."""

    out: Path = Path("runs/figures")
    """Folder to write; runs in its folder runs are drawn as they are, missing ones are made."""
    overwrite: bool = False
    """Draw existing figures again; the runs are kept."""

    def __call__(self) -> int:
        """Draw."""
        from experiments.paper_figures.draw import draw_all

        draw_all(self.out, time.perf_counter(), self.overwrite)
        return 0
