"""What preparation makes of captures: each is prepared, and the physical figure follows it before and after.

``python -m experiments.studies.prepared_captures FILE...`` prints the table of `docs/validation/prepared-captures.md`,
a row a file as it is done.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from models.errors import ModelError
from models.mocap.clip import Clip, pose_difference
from models.mocap.preparation.prepare import Prepared, prepared
from models.mocap.preparation.well_formed import WellFormed, well_formed
from sim.body.tracking import TrackingConfig, report, tracked_motion

SECONDS = 8.0  # followed
FALLEN = 1.0  # m between the root and its reference

HEAD = (
    "| file | part | residual before % | after % | soles in stance mm | skate mm | joints, root moved RMS "
    "| processor time |\n"
    "|---|---|---|---|---|---|---|---|"
)


class Followed(NamedTuple):
    """How the physical figure followed a clip.

    Attributes
    ----------
    residual : float
        RMS of the residual force while the reference stands [body weights].
    fell : float or None
        When the root was first `FALLEN` from its reference [s].
    """

    residual: float
    fell: float | None

    def __str__(self) -> str:
        """In percent, with the time of the fall in brackets."""
        return f"{100 * self.residual:.1f}" + ("" if self.fell is None else f" [{self.fell:.1f} s]")


def followed(clip: Clip) -> Followed:
    """Follow a clip for `SECONDS`."""
    motion = tracked_motion(clip, SECONDS, TrackingConfig())
    away = np.linalg.norm(pose_difference(motion.poses, motion.reference.poses)[:, :3], axis=1)
    fallen = np.flatnonzero(away > FALLEN)
    fell = float(motion.reference.times[fallen[0]]) if len(fallen) else None
    return Followed(report(motion).residual_force, fell)


def row(name: str, made: Prepared) -> str:
    """A line of the table."""
    was, now = well_formed(made.captured), well_formed(made.clip)
    far = "" if made.near else " *"
    return (
        f"| {name} | {made.looped.kind} {made.clip.duration:.2f} s | {followed(made.captured)} | "
        f"{followed(made.clip)}{far} | {_soles(was)} → {_soles(now)} | "
        f"{1000 * was.skate:.0f} → {1000 * now.skate:.0f} | "
        f"{np.rad2deg(made.feasible.turned):.1f}°, {100 * made.feasible.moved:.1f} cm | {made.seconds:.1f} s |"
    )


def _soles(measures: WellFormed) -> str:
    return f"{1000 * measures.lowest:.0f}…{1000 * measures.highest:.0f}"


def main(paths: list[str]) -> None:
    """Print the table."""
    print(HEAD)
    for path in map(Path, paths):
        name = f"{path.parent.name}/{path.name}"
        try:
            print(row(name, prepared(path)), flush=True)
        except ModelError as error:
            print(f"| {name} | refused: {error} | | | | | | |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
