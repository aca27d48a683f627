"""What preparation makes of captures: each is prepared, and the physical figure follows it before and after.

``python -m experiments.studies.prepared_captures FILE...`` prints the table of `docs/validation/prepared-captures.md`,
a row a file as it is done.
"""

import sys
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from models.errors import ModelError
from models.mocap.clip import Clip, pose_difference
from models.mocap.library import embedded
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed
from sim.body.tracking import TrackingConfig, report, tracked_motion

SECONDS = 8.0  # followed
FALLEN = 1.0  # m between the root and its reference

FEASIBLE = 0.12  # body weights RMS, of jumps and fights
HEAD = (
    "| file | part, pace | residual before % | after % | if not: | motion lacks % | soles in stance mm | tilt ° "
    "| skate mm | stand out | ends rad/s | flights m/s² | joints beyond ° | joints, root moved RMS | most "
    "| processor time: s, times the clip, times simulating |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
)


class Followed(NamedTuple):
    """How the physical figure followed a clip.

    Attributes
    ----------
    residual : float
        RMS of the residual force while the reference stands [body weights].
    fell : float or None
        When it first fell, or its root was `FALLEN` from its reference [s].
    cost : float
        Processor time of simulating a second [s].
    """

    residual: float
    fell: float | None
    cost: float

    @property
    def stands(self) -> bool:
        """Whether it did not fall, with a residual that is bearable."""
        return self.fell is None and self.residual <= FEASIBLE

    def __str__(self) -> str:
        """In percent, with the time of the fall in brackets."""
        return f"{100 * self.residual:.1f}" + ("" if self.fell is None else f" [{self.fell:.1f} s]")


def followed(clip: Clip) -> Followed:
    """Follow a clip for `SECONDS`."""
    began = process_time()
    motion = tracked_motion(clip, SECONDS, TrackingConfig())
    cost = (process_time() - began) / SECONDS
    away = np.linalg.norm(pose_difference(motion.poses, motion.reference.poses)[:, :3], axis=1)
    told = report(motion)
    fallen = [*motion.reference.times[away > FALLEN][:1].tolist(), *told.falls[:1]]
    return Followed(told.residual_force, min(fallen, default=None), cost)


def row(name: str, made: Prepared) -> str:
    """A line of the table."""
    was, now = well_formed(made.captured), well_formed(made.clip)
    before, after = followed(made.captured), followed(made.clip)
    change, seconds = made.feasible, made.clip.duration
    why = "" if after.stands else "motion" if not made.near or change.residual > FEASIBLE / 2 else "figure"
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
        f"{was.falling:.1f} → {now.falling:.1f}",
        f"{np.rad2deg(was.excess):.0f} → {np.rad2deg(max(now.excess, 0.0)):.0f}",
        f"{np.rad2deg(change.turned):.1f}°, {100 * change.moved:.1f} cm",
        f"{change.joint} {np.rad2deg(change.most_turned):.0f}°, {100 * change.furthest:.0f} cm",
        f"{made.seconds:.1f}, {made.seconds / seconds:.1f}, {made.seconds / (seconds * after.cost):.0f}",
    )
    return "| " + " | ".join(cells) + " |"


def _soles(measures: WellFormed) -> str:
    return f"{1000 * measures.lowest:.0f}…{1000 * measures.highest:.0f}"


def main(paths: list[str]) -> None:
    """Print the table."""
    print(HEAD)
    followed(embedded("walk"))  # what is compiled once costs no clip anything
    for path in map(Path, paths):
        name = f"{path.parent.name}/{path.name}"
        try:
            print(row(name, prepared(path)), flush=True)
        except ModelError as error:
            print(f"| {name} | refused: {error} |{' |' * 14}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
