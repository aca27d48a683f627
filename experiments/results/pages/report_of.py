"""Figures and page of a run, drawn from its recording, also if the run was interrupted."""

import json
from pathlib import Path
from typing import cast

from experiments.files.curve_files import CURVE_FILE
from experiments.results.folder import FIGURES, RECORDING, REPORT, SUMMARY, world_of
from experiments.results.pages.figures import draw_figures
from experiments.results.pages.hardware_report import write_hardware_report
from experiments.results.pages.lead_figure import draw_lead
from experiments.results.pages.report import write_report
from experiments.results.pages.stretch_figure import draw_stretch
from sim.errors import SimError
from sim.recording.recording import Recording


def write_report_of(folder: Path) -> None:
    """Draw the figures and the page of a run from its recording.

    Raises
    ------
    SimError
        If it was recorded by an incompatible version of the program.
    """
    with Recording(folder / RECORDING) as recording:
        if "frames" not in recording.groups:  # a hardware run, which has no figure in the loop
            write_hardware_report(folder, recording, lines_of(recording, folder))
            return
        if "title" not in recording.texts:
            raise SimError(
                f"{recording.path}: lacks its title; it was recorded by another version of the program, "
                "which can draw it, or run it again"
            )
        figures = draw_figures(recording, folder / FIGURES)
        if (folder / CURVE_FILE).exists():
            figures.insert(0, folder / FIGURES / "stretch.png")
            draw_stretch(recording, folder, figures[0])
        if recording.texts["hand_does"] == "leads":
            figures.insert(0, folder / FIGURES / "lead.png")
            draw_lead(recording, figures[0])
        title, lines = recording.texts["title"], lines_of(recording, folder)
        write_report(folder / REPORT, recording, world_of(recording), title, lines, figures)


def lines_of(recording: Recording, folder: Path) -> list[str]:
    """Summary of a run in words: from its recording, or else from summary.json, with a remark if it was interrupted."""
    if recording.summary is not None and "lines" in recording.summary:
        return [str(line) for line in cast(list[object], recording.summary["lines"])]
    # The recorder of a hardware run gets rows only; the summary is in the folder.
    whole = recording.summary is not None
    stopped = [] if whole else [f"The run was stopped: {recording.channel('ticks', 't')[-1]:.1f} s of it are recorded."]
    try:
        found = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))["lines"]
    except (OSError, ValueError, KeyError, TypeError):
        return stopped
    return [*stopped, *map(str, found)]
