"""``hvf prepare``: a capture made well-formed, with a line in the terminal and a page that shows what was done."""

from html import escape
from pathlib import Path

import numpy as np

from experiments.files.html_page import html_page, image
from experiments.preparation.filmstrip import filmstrip
from models.errors import ModelError
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.retarget import Hints


def prepare_file(
    source: Path, target: Path, loop: str = "auto", mirror: bool = False, hints: Hints | None = None,
    report: Path | None = None, overwrite: bool = False,
) -> Prepared:  # fmt: skip
    """Make a well-formed clip of the motion in a file, and write it as BVH on the figure.

    Parameters
    ----------
    source, target : Path
        Motion file to read, BVH file to write.
    loop : str
        ``auto``, ``open``, or ``START:END`` of the cycle in seconds.
    mirror : bool
        Exchange left and right.
    hints : Hints or None
        What a person knows of the file.
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
    if target.suffix.lower() != ".bvh":
        raise ModelError(f"cannot write {target}: only BVH is written; expected a name that ends in .bvh")
    if target.exists() and not overwrite:
        raise ModelError(f"{target} exists and is left as it is; expected a new name, or --overwrite")
    made = prepared(source, loop, mirror, hints)
    try:
        write_bvh(made.clip, target)
        if report is not None:
            report.mkdir(parents=True, exist_ok=True)
            (report / f"prepare-{source.stem}.html").write_text(page(made), encoding="utf-8")
    except OSError as error:
        raise ModelError(
            f"cannot write {error.filename}: {error.strerror}; expected a place that can be written"
        ) from None
    return made


def summary(made: Prepared, measures: WellFormed) -> str:
    """One line for the terminal."""
    whole = made.looped.kind == "cycle"
    part = f"cycle {made.looped.start:.2f} to {made.looped.end:.2f} s" if whole else made.looped.kind
    faults = list(measures.faults())
    if not made.near:
        faults.insert(0, "no feasible motion is near it, so dynamics and feet are as captured")
    return (
        f"{made.clip.name}: {part}, {made.clip.duration:.2f} s; "
        f"contact lacks {100 * measures.residual:.1f} % of weight; "
        f"joints moved {np.rad2deg(made.feasible.turned):.1f}°, root {100 * made.feasible.moved:.1f} cm RMS; "
        f"{made.seconds:.0f} s of processor time; "
        + ("well-formed" if not faults else "not well-formed: " + "; ".join(faults))
    )


def page(made: Prepared) -> str:
    """The report as a self-contained page: before and after, what was done, and both as rows of pictures."""
    before, after = well_formed(made.captured), well_formed(made.clip)
    picture = image(filmstrip({"as captured": made.captured, "prepared": made.clip}), "stick figures")
    rows = "".join(
        f"<tr><td>{name}</td><td>{escape(was)}</td><td>{escape(now)}</td></tr>"
        for name, was, now in zip(
            ("soles", "ends", "continuity", "dynamics"), before.lines(), after.lines(), strict=True
        )
    )
    said = [*(made.report.lines() if made.report else ()), summary(made, after)]
    body = (
        f'<div class="wide"><table><tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table></div>'
        + picture
        + "".join(f"<p>{escape(line)}</p>" for line in said)
    )
    style = "th, td { text-align: left; vertical-align: top; }"
    return html_page(f"{made.clip.name}, prepared", body, style)
