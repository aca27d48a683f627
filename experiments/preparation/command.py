"""``hvf prepare``: makes a capture well-formed, and reports what was changed in a line and on a page."""

from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.files.html_page import html_page, image
from experiments.flights.ballistics import clip_ballistics
from experiments.preparation.both import both_html
from experiments.preparation.filmstrip import filmstrip
from experiments.preparation.followed import Followed, followed
from models.mocap.library import check_target, writing
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.hints import Hints

_CARRIED = 0.02  # [m] displacement of the root below which nothing is said: stances are extended over as much


class PreparedFile(NamedTuple):
    """A prepared clip with its measures.

    Attributes
    ----------
    made : Prepared
        The clip and the steps of its preparation.
    measures : WellFormed
        Measures of the clip.
    followed : Followed
        How the physical figure follows it.
    flights : tuple of str
        Flights that the certificate refutes, and why, a line each.
    """

    made: Prepared
    measures: WellFormed
    followed: Followed
    flights: tuple[str, ...]

    def faults(self) -> tuple[str, ...]:
        """Measures that exceed their bounds, a line each."""
        return (
            *self.measures.faults(),
            *self.made.fidelity.faults(),
            *self.flights,
            *self.followed.faults(self.measures.flights > 0),
        )


def prepare_file(
    source: Path, target: Path, loop: str = "auto", mirror: bool = False, hints: Hints | None = None,
    report: Path | None = None, overwrite: bool = False,
) -> PreparedFile:  # fmt: skip
    """Make a well-formed clip of the motion in a file, and write it as BVH on the figure.

    Parameters
    ----------
    source, target : Path
        Motion file to read, BVH file to write.
    loop : str
        ``auto``, ``open``, or ``START:END`` of the cycle in seconds.
    mirror : bool
        Continue half a stride, or START:END, by its mirror image.
    hints : Hints or None
        Facts about the file that the user states.
    report : Path or None
        Folder for the page ``prepare-NAME.html``.
    overwrite : bool
        Replace the target if it exists.

    Raises
    ------
    MotionFileError
        If the source cannot be read, or contradicts itself.
    ModelError
        If the target is not a .bvh, cannot be written, or exists and is not to be overwritten.
    """
    check_target(target, overwrite)
    made = prepared(source, loop, mirror, hints)
    refuted = tuple(flight.reason for flight in clip_ballistics(made.clip).flights if flight.verdict == "refuted")
    outcome = PreparedFile(made, well_formed(made.clip), followed(made.clip), refuted)
    with writing(target):
        write_bvh(made.clip, target)
        if report is not None:
            report.mkdir(parents=True, exist_ok=True)
            (report / f"prepare-{source.stem}.html").write_text(page(outcome), encoding="utf-8")
    return outcome


def summary(outcome: PreparedFile) -> str:
    """One line for the terminal."""
    made, faults = outcome.made, outcome.faults()
    return (
        f"{made.clip.name}: {'; '.join(changes(made))}; "
        f"contact lacks {100 * outcome.measures.residual:.1f} % of weight; {outcome.followed.line()}; "
        f"{made.seconds:.0f} s of processor time; "
        + ("well-formed" if not faults and made.near else "not well-formed: " + "; ".join(faults))
        + "".join(f"; {line}" for line in advice(made))
    )


def changes(made: Prepared) -> tuple[str, ...]:
    """Changes made to the capture, a line each."""
    part, pace, change = made.looped, made.paced, made.feasible
    words = {
        "cycle": f"cycle {part.start:.2f} to {part.end:.2f} s, whose ends were {np.rad2deg(part.gap):.1f}° apart",
        "half stride": f"half a stride, {part.start:.2f} to {part.end:.2f} s, and its mirror image",
        "way back": "the whole, and a way back",
        "open": "the whole, at rest at both ends",
    }
    lines = [f"{words[part.kind]}: {made.clip.duration:.2f} s"]
    if pace.pace != 1.0:
        lines.append(f"played {pace.pace:.2f} times as fast, since its flights fall with {pace.falls:.1f} m/s²")
    if made.carried > _CARRIED:
        lines.append(
            f"carried over the floor by up to {100 * made.carried:.0f} cm, since a foot that bears the load slides"
        )
    if not made.near:
        return (*lines, "dynamics and feet as captured")
    if made.hands.seconds > 0.0:
        lines.append(
            f"hands bear load for {made.hands.seconds:.2f} s, on places up to {100 * made.hands.moved:.0f} cm from "
            "where their palms were captured"
        )
    lines.append(
        f"dynamics moved joints {np.rad2deg(change.turned):.1f}°, the root {100 * change.raised:.1f} cm in height and "
        f"{100 * change.moved:.1f} cm over the floor RMS; " + made.fidelity.line()
    )
    return tuple(lines)


def advice(made: Prepared) -> tuple[str, ...]:
    """Advice, if no feasible motion is near the capture: how far the nearest one found is, and what may help."""
    change = made.feasible
    if made.near:
        return ()
    return (
        f"no feasible motion is near: the nearest found turns joints by {np.rad2deg(change.turned):.0f}° and raises or "
        f"lowers the root by {100 * change.raised:.0f} cm RMS, and still lacks {100 * change.residual:.0f} % of weight",
        "try --loop START:END for a part without what is not feasible, --loop open if it "
        "does not repeat, or a capture whose support is feet and hands alone",
    )


def page(outcome: PreparedFile) -> str:
    """The report as a self-contained page: measures before and after, what was changed, pictures and replay of both."""
    made = outcome.made
    before = well_formed(made.captured)
    picture = image(filmstrip({"as captured": made.captured, "prepared": made.clip}), "stick figures")
    rows = "".join(
        f"<tr><th>{name}</th><td>{escape(was)}</td><td>{escape(now)}</td></tr>"
        for name, was, now in zip(
            ("soles", "ends", "continuity", "dynamics"), before.lines(), outcome.measures.lines(), strict=True
        )
    )

    def listed(title: str, lines: tuple[str, ...]) -> str:
        points = "".join(f"<li>{escape(line)}</li>" for line in lines)
        return f"<h2>{title}</h2><ul>{points}</ul>" if lines else ""

    well = "Well-formed." if made.near and not outcome.faults() else "Not well-formed."
    body = (
        f'<p>{well} {escape(outcome.followed.line().capitalize())}.</p><div class="wide"><table>'
        f"<tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table></div>"
        + listed("What was changed", changes(made))
        + listed("What is not within bounds", (*outcome.faults(), *advice(made)))
        + f'<iframe title="both in 3D" srcdoc="{escape(both_html(made.captured, made.clip))}"></iframe>'
        + picture
        + listed("What the file was taken for", made.report.lines() if made.report else ())
    )
    style = "th, td { text-align: left; vertical-align: top; }"
    return html_page(f"{made.clip.name}, prepared", body, style)
