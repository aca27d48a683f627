"""Effect of preparation on captures: each is prepared, and the physical figure follows it before and after.

``python -m experiments.studies.prepared_captures FILE...`` prints the table of `docs/validation/prepared-captures.md`,
a row per file as it is completed.
"""

import sys
from pathlib import Path

import numpy as np

from experiments.flights.ballistics import clip_flights
from experiments.preparation.followed import followed
from models.errors import ModelError
from models.mocap.library import embedded
from models.mocap.preparation.bounds import FLYING
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed

SECONDS = 20.0  # [s] for which the figure follows each clip
HEAD = (
    "| file | part, pace | residual before % | after % | if not: | motion lacks % | soles in stance mm | tilt ° "
    "| skate mm | stand out | ends rad/s | flights: m/s² beside gravity (number) | joints beyond ° "
    "| joints, root from the capture, RMS | most | processor time: s, times the clip, times simulating |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def row(name: str, made: Prepared) -> str:
    """A line of the table."""
    was, now = (well_formed(clip, clip_flights(clip)) for clip in (made.captured, made.clip))
    before, after = followed(made.captured, SECONDS), followed(made.clip, SECONDS)
    change, kept, seconds = made.feasible, made.fidelity, made.clip.duration
    most = kept.extremes[0]
    why = "" if after.stands else "motion" if not made.near or change.residual > FLYING / 2 else "figure"
    cells = (
        name,
        f"{made.looped.kind} {seconds:.2f} s" + (f", {made.paced.pace:.2f}×" if made.paced.pace != 1.0 else ""),
        f"{before}",
        f"{after}" + ("" if made.near else " *"),
        why,
        f"{100 * change.residual:.1f}",
        f"{_soles(was)} → {_soles(now)}",
        f"{np.rad2deg(was.tilt):.0f} → {np.rad2deg(now.tilt):.1f}",
        f"{1000 * was.skate:.0f} → {1000 * now.skate:.0f}",
        f"{was.outliers} → {now.outliers}",
        f"{was.seam:.1f} → {now.seam:.1f}",
        f"{_flights(was)} → {_flights(now)}",
        f"{np.rad2deg(was.excess):.0f} → {np.rad2deg(max(now.excess, 0.0)):.0f}",
        f"{np.rad2deg(kept.joints):.1f}°, {100 * kept.root:.1f} cm",
        f"{most.joint} {np.rad2deg(most.angle):.0f}°",
        f"{made.seconds:.1f}, {made.seconds / seconds:.1f}, {made.seconds / (seconds * after.cost):.0f}",
    )
    return "| " + " | ".join(cells) + " |"


def _flights(measures: WellFormed) -> str:
    return f"{measures.falling:.1f} ({measures.flights})" if measures.flights else "none"


def _soles(measures: WellFormed) -> str:
    return f"{1000 * measures.lowest:.0f}…{1000 * measures.highest:.0f}"


def main(paths: list[str]) -> None:
    """Print the table."""
    print(HEAD)
    followed(embedded("walk"), SECONDS)  # compiles the units first, so that no clip's time includes that
    for path in map(Path, paths):
        name = f"{path.parent.name}/{path.name}"
        try:
            print(row(name, prepared(path)), flush=True)
        except ModelError as error:
            print(f"| {name} | refused: {error} |{' |' * 14}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
