"""``hvf prepare``: make a capture well-formed, and write it and a report page."""

from pathlib import Path

from controllers.checks import check_kind
from experiments.files.given_path import given_path
from experiments.flights.ballistics import clip_ballistics, clip_flights
from experiments.preparation.followed import TRIAL_SECONDS
from experiments.preparation.prepared_file import Measured, PreparedFile, doubts
from experiments.preparation.tracking_trial import followed
from experiments.results.measures.soles import Soles
from geometry.whole_files import write_text
from models.mocap.library import check_target, writing
from models.mocap.motion.clip import CLOSURE_TOLERANCE, Clip
from models.mocap.preparation.prepare import prepared
from models.mocap.preparation.well_formed import well_formed
from models.mocap.readers.own_bvh import write_bvh
from models.mocap.retargeting.hints import Hints
from models.world.scene import SceneConfig


def prepare_file(
    source: str | Path, target: str | Path, loop: str = "auto", mirror: bool = False, hints: Hints | None = None,
    report: str | Path | None = None, overwrite: bool = False,
) -> PreparedFile:  # fmt: skip
    """Make a well-formed clip of the motion in a file, and write it as BVH on the figure.

    Parameters
    ----------
    source, target : path
        Motion file to read, BVH file to write.
    loop : str
        ``auto``, ``open``, or ``START:END`` of the cycle in seconds.
    mirror : bool
        Continue half a stride, or START:END, by its mirror image.
    hints : Hints, optional
        Facts about the file that the user states.
    report : path, optional
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
    for name, value, kind in (
        ("loop", loop, str), ("mirror", mirror, bool), ("hints", hints, Hints | None), ("overwrite", overwrite, bool),
    ):  # fmt: skip
        check_kind(name, value, kind)
    source, target = given_path("source", source), given_path("target", target)
    report = None if report is None else given_path("report", report)
    check_target(target, overwrite)
    result = prepared(source, loop, mirror, hints)
    found = clip_ballistics(result.clip)
    refuted = tuple(flight.reason for flight in found.flights if flight.verdict == "refuted")
    outcome = PreparedFile(result, *_measure(result.clip), refuted, doubts(found))
    captured = None if report is None else _measure(result.captured)
    with writing(target):
        write_bvh(result.clip, target)
        if report is not None and captured is not None:
            from experiments.preparation.page import page  # late: matplotlib and viser

            report.mkdir(parents=True, exist_ok=True)
            write_text(report / f"prepare-{source.stem}.html", page(outcome, captured))
    return outcome


def _measure(clip: Clip) -> Measured:
    follows = followed(clip, max(TRIAL_SECONDS, clip.duration))
    return Measured(well_formed(clip, clip_flights(clip)), follows, foot_slide(clip))


def foot_slide(clip: Clip) -> float:
    """How far a foot slides over the floor at most, across the seam of a closed clip too [m]."""
    soles = Soles(SceneConfig())
    soles.add((clip.with_next_lap() if clip.closes(CLOSURE_TOLERANCE) else clip).poses)
    return soles.slide
