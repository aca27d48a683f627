"""``hvf prepare``: a capture made well-formed, with a line in the terminal and a page that shows what was done."""

from base64 import b64encode
from html import escape
from io import BytesIO
from pathlib import Path

import numpy as np

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
    picture = BytesIO()
    filmstrip({"as captured": made.captured, "prepared": made.clip}).savefig(picture, format="png", dpi=110)
    rows = "".join(
        f"<tr><td>{name}</td><td>{escape(was)}</td><td>{escape(now)}</td></tr>"
        for name, was, now in zip(
            ("soles", "ends", "continuity", "dynamics"), before.lines(), after.lines(), strict=True
        )
    )
    said = [*(made.report.lines() if made.report else ()), summary(made, after)]
    return (
        f'<!doctype html><meta charset="utf-8"><title>{escape(made.clip.name)} prepared</title>'
        "<style>body{font:15px system-ui;margin:2em;max-width:80em}td{padding:.3em 1em .3em 0;vertical-align:top}"
        "img{max-width:100%}</style>"
        f"<h1>{escape(made.clip.name)}</h1><table><tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table>"
        f'<img alt="stick figures" src="data:image/png;base64,{b64encode(picture.getvalue()).decode()}">'
        + "".join(f"<p>{escape(line)}</p>" for line in said)
    )
