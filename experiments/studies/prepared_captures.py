"""Effect of preparation on captures: each is prepared, and the physical figure follows it before and after.

``python -m experiments.studies.prepared_captures FILE...`` prints the table of `docs/validation/prepared-captures.md`,
a row per file as it is completed.
"""

import sys
from pathlib import Path
from time import process_time

import numpy as np

from experiments.flights.ballistics import clip_flights
from experiments.preparation.followed import Followed
from experiments.preparation.source_deviation import deviations
from experiments.preparation.tracking_trial import followed
from experiments.studies.random_sets import JUDGING, TUNING
from models.errors import ModelError
from models.mocap.library import embedded
from models.mocap.preparation.bounds import MAX_RESIDUAL_IN_FLIGHTS
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed

TABLE_HEADER = (
    "| file | half | part, pace | residual before % | after % | fault of | residual of the motion % "
    "| segments from the file ° | joints from the file cm | soles in stance mm | tilt ° | skate mm | outliers "
    "| ends rad/s | flights: m/s² beside gravity (number) | joints beyond ° | torques % of limits "
    "| joints, root from the capture, RMS | most | processor time: s, times the clip, times simulating |\n"
    "|" + 20 * "---|"
)


def row(path: Path, result: Prepared) -> str:
    """A line of the table."""
    was, now = (well_formed(clip, clip_flights(clip)) for clip in (result.captured, result.clip))
    before, began = followed(result.captured), process_time()
    after = followed(result.clip)
    cost = (process_time() - began) / after.seconds
    tried, kept, seconds = result.attempt, result.fidelity, result.clip.duration
    most, directions, places = kept.extremes[0], *_source_deviations(path, result)
    motion_is_near = result.near and tried.residual <= MAX_RESIDUAL_IN_FLIGHTS / 2
    why = "" if after.stands else "figure" if motion_is_near else "motion"
    cells = (
        _file_name(path),
        _half_name(path),
        f"{result.looped.kind} {seconds:.2f} s" + (f", {result.paced.pace:.2f}×" if result.paced.pace != 1.0 else ""),
        _followed_text(before),
        _followed_text(after) + ("" if result.near else " *"),
        why,
        f"{100 * tried.residual:.1f}",
        directions,
        places,
        f"{_soles_text(was)} → {_soles_text(now)}",
        f"{np.rad2deg(was.tilt):.0f} → {np.rad2deg(now.tilt):.1f}",
        f"{1000 * was.skate:.0f} → {1000 * now.skate:.1f}",
        f"{was.outliers} → {now.outliers}",
        f"{was.seam:.1f} → {now.seam:.1f}",
        f"{_flights_text(was)} → {_flights_text(now)}",
        f"{np.rad2deg(was.excess):.0f} → {np.rad2deg(max(now.excess, 0.0)):.0f}",
        f"{100 * was.strain:.0f} → {100 * now.strain:.0f} {now.joint}",
        f"{np.rad2deg(kept.joints):.1f}°, {100 * kept.root:.1f} cm",
        f"{most.joint} {np.rad2deg(most.angle):.0f}°",
        f"{result.seconds:.1f}, {result.seconds / seconds:.1f}, {result.seconds / (seconds * cost):.0f}",
    )
    return "| " + " | ".join(cells) + " |"


def _file_name(path: Path) -> str:
    return f"{path.parent.name}/{path.name}"


def _half_name(path: Path) -> str:
    name = _file_name(path)
    return "tuning" if name in TUNING else "judging" if name in JUDGING else ""


def _source_deviations(path: Path, result: Prepared) -> tuple[str, str]:
    """Largest deviations of segments and joints from the file, as retargeted and as prepared."""
    both = deviations(path, result)
    if both is None:
        return "its own skeleton", "its own skeleton"
    was, now = both
    return (
        f"{np.rad2deg(was.direction):.1f} → {np.rad2deg(now.direction):.1f} {now.segment}",
        f"{100 * was.place:.1f} → {100 * now.place:.1f} {now.joint}",
    )


def _followed_text(result: Followed) -> str:
    return f"{100 * result.residual:.1f}" + ("" if result.fell is None else f" [{result.fell:.1f} s]")


def _flights_text(measures: WellFormed) -> str:
    return f"{measures.flight_error:.1f} ({measures.flights})" if measures.flights else "none"


def _soles_text(measures: WellFormed) -> str:
    return f"{1000 * measures.lowest:.0f}…{1000 * measures.highest:.0f}"


def main(paths: list[str]) -> None:
    """Print the table."""
    print(TABLE_HEADER)
    followed(embedded("walk"))  # compiles the units first, so that no clip's time includes that
    for path in map(Path, paths):
        try:
            print(row(path, prepared(path)), flush=True)
        except ModelError as error:
            print(f"| {_file_name(path)} | {_half_name(path)} | refused: {error} |{17 * ' |'}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
