"""report.html, the page of a run in one self-contained file: summary in words, replay in 3D, plots and figures."""

import html
from collections.abc import Sequence
from pathlib import Path

import mujoco

from experiments.files.html_page import html_page, image
from experiments.results.pages.plots import plots_html
from sim.recording.recording import Recording
from sim.viewer.courses import courses
from sim.viewer.palette import FIELD, PUSH, USER
from sim.viewer.replay_html import MAGNIFICATION, SECONDS, drawn_tube, replay_html

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
    replayed = "" if seconds <= SECONDS else f"The replay shows the first {SECONDS:g} of {seconds:.0f} seconds."
    radius, drawn = float(recording.arrays["tube_radius"]), drawn_tube(recording)
    tube = "" if drawn == radius else f", drawn with a radius of {1e3 * drawn:.0f} mm for its {1e3 * radius:.0f} mm"
    body = _BODY.format(
        lines="".join(f"<li>{html.escape(line)}</li>" for line in lines),
        replay=html.escape(replay_html(recording, model)),
        replayed=replayed,
        plots=plots_html(recording),
        curves=_curve_legend(recording, tube),
        push=PUSH,
        field=FIELD,
        user=USER,
        magnification=MAGNIFICATION,
        figures="".join(image(figure, figure.stem) for figure in figures),
        versions=html.escape(", ".join(f"{name} {number}" for name, number in recording.versions.items())),
        seed=recording.seed,
    )
    path.write_text(html_page(title, body, _STYLE), encoding="utf-8")


def _curve_legend(recording: Recording, tube: str) -> str:
    """Legend of the replay: colours of the curve and its tube, or of each river, and a remark if the curve was bent."""
    name, drawn = recording.texts.get("tube_name", "tube"), courses(recording.static)
    if drawn[0].name:
        rivers = ", ".join(f'<b style="color:{course.line}">{html.escape(course.name)}</b>' for course in drawn)
        return f"The rivers, each in its {name}{tube}: {rivers}."
    bent = recording.texts.get("hand_does", "").startswith("grabs")
    about = f"Light blue: the {name} around the curve{tube}." if recording.arrays["tube_radius"] > 0.0 else ""
    return about + " The curve is drawn as it was before it was bent." * bent
