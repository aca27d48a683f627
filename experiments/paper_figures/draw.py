"""Draws all figures of the paper: performs the runs that they need, writes the drawings as PDF and PNG, and a page."""

import html
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from experiments.files.figure_files import save_figure
from experiments.files.html_page import html_page
from experiments.paper_figures.bent_and_crossing import crossing_rivers, rendered_result, stretching
from experiments.paper_figures.curves_and_fields import field_and_map, trajectory_and_vectors, v_plus_u
from experiments.paper_figures.cylinder import four_motion_cylinder, red_and_blue_inputs
from experiments.paper_figures.sources import COMPOSITE, CYLINDER, RIVERS, STRETCH, configs
from experiments.results.folder import RECORDING
from experiments.results.pages.figures import STYLE
from experiments.runs.run import run
from geometry.whole_files import write_text
from sim.errors import SimError
from sim.recording.recording import Recording

DPI = 170  # pixels per inch
PAGE = "index.html"


class Drawing(NamedTuple):
    """A figure of the paper.

    Attributes
    ----------
    number : int
    title : str
        Subject of the paper's figure, in a few words.
    shows : str
        What is drawn here, and from which run.
    runs : tuple of str
        Runs that the figure needs.
    draw : callable
        Draws the figure from the folder of runs.
    """

    number: int
    title: str
    shows: str
    runs: tuple[str, ...]
    draw: Callable[[Path], Figure]


DRAWINGS = (
    Drawing(1, "A trajectory and its vectors",
            "The curve φ of FOLLOW with its tangent vectors; the recorded path of a hand that pushes outwards "
            "and inwards, and the force of the field on it.", (CYLINDER,), trajectory_and_vectors),
    Drawing(2, "A field and the map to poses",
            "From above: the recorded forces along the path of the pushing hand within the domain of the map, and the "
            "poses that h assigns to twelve points of a lap.", (CYLINDER,), field_and_map),
    Drawing(3, "Four motions on a cylinder, with FOLLOW",
            "The angle is the frame of the motion; radius and height mix four motions, one on each edge. A hand that "
            "is led, and then pushes; frames of the resulting animation.", (CYLINDER,), four_motion_cylinder),
    Drawing(4, "V + U",
            "A river V, the performance φ' that left it, and U, what the performance added to V. Integrated again, "
            "V + U gives the performance.", (CYLINDER,), v_plus_u),
    Drawing(5, "Red and blue inputs",
            "One motion moves the lower body (red), the hand mixes two others for the upper body (blue).",
            (COMPOSITE,), red_and_blue_inputs),
    Drawing(6, "A stretchy tube: before, after, and FOLLOW",
            "The curve as it was given; bent by a hand that held it with the stylus switch; performed by FOLLOW, with "
            "the largest force on the hand.", (STRETCH,), stretching),
    Drawing(7, "The result, rendered",
            "The bent curve performed by the physical figure, with the animation of the curve before it was bent "
            "beside it.", (STRETCH,), rendered_result),
    Drawing(8, "Crossing rivers",
            "Three rivers with a motion each; a hand that pushes at a crossing changes to another one, and the "
            "figure with it.", (RIVERS,), crossing_rivers),
)  # fmt: skip


def draw_all(out: Path, started: float, overwrite: bool = False) -> list[Path]:
    """Draw all figures into a folder, from the runs in its folder ``runs``; missing runs are performed first.

    Parameters
    ----------
    out : Path
        Folder.
    started : float
        `time.perf_counter` when the program began.
    overwrite : bool
        Replace existing figures.

    Returns
    -------
    list of Path
        The PNG files.

    Raises
    ------
    SimError
        If the folder holds figures already, or a recording is not of the expected run.
    """
    if (out / PAGE).exists() and not overwrite:
        raise SimError(f"{out}: holds figures; choose another --out, or --overwrite them (their runs are kept)")
    console = Console(stderr=True)
    runs = out / "runs"
    run_configs = configs()
    missing = [name for name in run_configs if not _has_recording(runs / name)]
    for k, name in enumerate(missing):
        console.print(f"Run {k + 1} of {len(missing)} that are missing: {name}.", highlight=False)
        run(run_configs[name], runs / name, True, started)
    files: list[Path] = []
    columns = (TextColumn("drawing"), BarColumn(), TextColumn("{task.completed} of {task.total}"))
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        for drawing in bar.track(DRAWINGS):
            files.append(draw_one(drawing, runs, out))
    write_text(out / PAGE, _page())
    console.print(f"Written to {out}: {PAGE} (open it in a browser), eight figures as PDF and PNG.", highlight=False)
    return files


def draw_one(drawing: Drawing, runs: Path, out: Path) -> Path:
    """Draw a figure as PDF and PNG; returns the PNG."""
    stem = out / f"figure-{drawing.number}"
    with mpl.rc_context(STYLE):
        figure = drawing.draw(runs)
        # Without a creation date, so that the same recordings give the same file.
        save_figure(figure, stem.with_suffix(".pdf"), metadata={"CreationDate": None})
        save_figure(figure, stem.with_suffix(".png"), dpi=DPI)
    return stem.with_suffix(".png")


def _has_recording(folder: Path) -> bool:
    file = folder / RECORDING
    if not file.exists():
        return False
    with Recording(file) as recording:
        return recording.complete


def _page() -> str:
    """HTML of the figures, one below the other, each with its description."""
    parts = [
        f'<figure id="figure-{d.number}"><a href="figure-{d.number}.pdf"><img alt="{html.escape(d.title)}" '
        f'src="figure-{d.number}.png"></a><figcaption><b>Figure {d.number}. {html.escape(d.title)}.</b> '
        f"<br><i>Here:</i> {html.escape(d.shows)} <small>Run: {', '.join(d.runs)}.</small></figcaption></figure>"
        for d in DRAWINGS
    ]
    return html_page("Figures 1 to 8 of the paper, from runs of this program", _INTRO + "\n".join(parts), _CSS)


_CSS = """figure { margin: 2.5rem 0; }
img { width: 100%; }
figcaption { font-size: .95rem; color: #566072; }
figcaption b { color: #222a38; }"""
_INTRO = """<p>Donald &amp; Henle, “Using Haptic Vector Fields for Animation Motion Control”, ICRA 2000. In bold, in our
words, what the paper's figure of that number shows (its captions are not repeated); then what is drawn here, from
recordings. A click gives the PDF.</p>
"""
