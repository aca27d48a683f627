"""Figures of a run and its page, report.html: summary in words, replay in 3D, plots; also if it was interrupted."""

import html
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
from matplotlib.figure import Figure

from experiments.files.curve_files import CURVE_FILE, load_curve
from experiments.files.html_page import html_page, image
from experiments.results.folder import FIGURES, RECORDING, REPORT, SUMMARY, world_of
from experiments.results.pages.figures import draw_figures, save_figures
from experiments.results.pages.hardware_report import write_hardware_report
from experiments.results.pages.mode_figures import arm_figure, lead_figure, stretch_figure
from experiments.results.pages.plots import plots_html
from geometry.whole_files import write_text
from sim.errors import SimError
from sim.recording.recording import Recording
from sim.viewer.palette import FIELD, MIN_PUSH_FORCE, USER
from sim.viewer.replay_html import MAGNIFICATION, MAX_SECONDS, drawn_tube, replay_html
from sim.viewer.shown import courses


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
        own: dict[str, Callable[[Recording], Figure]] = {}
        if "tool" in recording.groups["frames"]:
            own["arm"] = arm_figure
        if (folder / CURVE_FILE).exists():
            own["stretch"] = partial(stretch_figure, bent=load_curve(folder / CURVE_FILE))
        if recording.texts["hand_does"] == "leads":
            own["lead"] = lead_figure
        figures = save_figures(recording, folder / FIGURES, own) + draw_figures(recording, folder / FIGURES)
        title, lines = recording.texts["title"], lines_of(recording, folder)
        write_report(folder / REPORT, recording, world_of(recording), title, lines, figures)


def lines_of(recording: Recording, folder: Path) -> list[str]:
    """Remarks and summary of a run in words: from its recording or summary.json; whether it was interrupted first."""
    if recording.summary is not None and "lines" in recording.summary:
        return _words_of(recording.summary)
    # The recorder of a hardware run gets rows only; the summary is in the folder.
    whole = recording.summary is not None
    stopped = [] if whole else [f"The run was stopped: {recording.channel('ticks', 't')[-1]:.1f} s of it are recorded."]
    try:
        return [*stopped, *_words_of(json.loads((folder / SUMMARY).read_text(encoding="utf-8")))]
    except (OSError, ValueError, KeyError, TypeError):
        return stopped


def _words_of(summary: Mapping[str, Any]) -> list[str]:
    return [str(line) for line in (*summary.get("remarks", ()), *summary["lines"])]


_STYLE = """
ul { margin: 0 0 1rem; padding-left: 1.2rem; }
p { font-size: .9rem; color: #566072; margin: .5rem 0; }
p b { font-weight: 600; }
.figures { columns: min(26rem, 100%); column-gap: 1.5rem; }
.figures img { width: 100%; margin-bottom: 1rem; break-inside: avoid; }
@media (max-width: 600px) { ul { overflow-wrap: anywhere; } }
"""
_BODY = """<ul>{lines}</ul>
<iframe title="Replay in 3D" srcdoc="{replay}"></iframe>
<p>Drag to turn, wheel to zoom, right button to move; space plays and pauses, the bar scrubs.
<b style="color:{field}">Green</b> arrow: force of the field. <b style="color:{user}">Orange</b> arrow: force of the
hand; where that is above {push:g} N, the path is orange too. {curves}
{replayed}
The Phantom is drawn {magnification:g} times larger and beside the figures; the simulation has them in one world at
their true size.</p>
{plots}
<h2>Figures</h2>
<div class="figures">{figures}</div>
<h2>Made with</h2>
<p>{versions}; seed {seed}.</p>
"""


def write_report(
    path: Path, recording: Recording, model: mujoco.MjModel, title: str, lines: Sequence[str], figures: Sequence[Path],
) -> None:  # fmt: skip
    """Write the report of a run.

    Parameters
    ----------
    path : Path
        HTML file to write.
    recording : Recording
        Recording with the channels that `replay_html` reads.
    model : mujoco.MjModel
        The world that was recorded.
    title : str
        Heading of the page.
    lines : sequence of str
        What happened, one sentence per line.
    figures : sequence of Path
        PNG files, which are embedded in the page.

    Raises
    ------
    RecordingError
        If the recording lacks a channel that is drawn.
    """
    t = recording.channel("ticks", "t")
    seconds = float(t[-1] - t[0])
    replayed = "" if seconds <= MAX_SECONDS else f"The replay shows the first {MAX_SECONDS:g} of {seconds:.0f} seconds."
    radius, drawn = float(recording.arrays["tube_radius"]), drawn_tube(recording)
    tube = "" if drawn == radius else f", drawn with a radius of {1e3 * drawn:.0f} mm for its {1e3 * radius:.0f} mm"
    body = _BODY.format(
        lines="".join(f"<li>{html.escape(line)}</li>" for line in lines),
        replay=html.escape(replay_html(recording, model)),
        replayed=replayed,
        plots=plots_html(recording),
        curves=_curve_legend(recording, tube),
        push=MIN_PUSH_FORCE,
        field=FIELD,
        user=USER,
        magnification=MAGNIFICATION,
        figures="".join(image(figure, figure.stem) for figure in figures),
        versions=html.escape(", ".join(f"{name} {number}" for name, number in recording.versions.items())),
        seed=recording.seed,
    )
    write_text(path, html_page(title, body, _STYLE))


def _curve_legend(recording: Recording, tube: str) -> str:
    """Legend of the replay: colours of the curve and its tube, or of each river, and a remark if the curve was bent."""
    name, drawn = recording.texts.get("tube_name", "tube"), courses(recording.static)
    if drawn[0].name:
        rivers = ", ".join(f'<b style="color:{course.line}">{html.escape(course.name)}</b>' for course in drawn)
        return f"The rivers, each in its {name}{tube}: {rivers}."
    bent = recording.texts.get("hand_does", "").startswith("grabs")
    about = f"Light blue: the {name} around the curve{tube}." if recording.arrays["tube_radius"] > 0.0 else ""
    return about + " The curve is drawn as it was before it was bent." * bent
