"""How little help the physical figure needs: clips at smaller and smaller bounds on the residual wrench.

``python -m experiments.studies.residual_bounds [CLIP or FILE...]`` prints the table of
`docs/validation/residual-bounds.md`, a row a clip as it is done. Runs of a figure with contacts are chaotic, so each
clip is followed at some speeds that differ in the sixth digit, and falls are counted.
"""

import sys
from collections.abc import Sequence

import numpy as np

from experiments.setups.clips import load_clips
from models.mocap.clip import Clip
from models.mocap.library import embedded_names
from sim.body.figure_state import FigureGains
from sim.body.tracking import TrackingConfig, track

BOUNDS = ((1.0, 0.2), (0.5, 0.1), (0.2, 0.04), (0.1, 0.02), (0.05, 0.01))
"""Force as a share of body weight, moment as one of body weight × stature."""

SECONDS, NUDGES = 8.0, (0.0, 1e-6, -1e-6)


def cell(clip: Clip, force: float, moment: float, seconds: float = SECONDS) -> str:
    """Runs that fell of all, and the median residual [% of body weight] of what is up."""
    config = TrackingConfig(gains=FigureGains(force_bound=force, moment_bound=moment))
    reports = [track(Clip(clip.poses, clip.fps * (1.0 + nudge), clip.name), seconds, config) for nudge in NUDGES]
    fell, residual = sum(bool(one.falls) for one in reports), np.median([one.residual_force for one in reports])
    return f"{fell} of {len(NUDGES)}, {100 * residual:.1f} %" if fell else f"{100 * residual:.1f} %"


def main(names: Sequence[str]) -> None:
    """Print the table."""
    print("| clip | " + " | ".join(f"{force:g}, {moment:g}" for force, moment in BOUNDS) + " |")
    print("|---" * (1 + len(BOUNDS)) + "|")
    for name in names:
        (clip,), _ = load_clips((name,))
        print(f"| {name} | " + " | ".join(cell(clip, *bounds) for bounds in BOUNDS) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or embedded_names())
