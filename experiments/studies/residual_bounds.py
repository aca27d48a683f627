"""The least residual wrench that the physical figure needs: clips and runs at decreasing bounds.

``python -m experiments.studies.residual_bounds [CLIP or FILE...]`` prints the first table of
`docs/validation/residual-bounds.md`, a row per clip as it is completed, and ``--runs`` the second, of runs in which the
animation is led, blended, pushed or played at another pace. Runs of a figure with contacts are chaotic, so each is
repeated with speeds of the clip, or weights of the figure, that differ in the sixth digit, and falls are counted.
"""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.config.options import run_config
from experiments.setups.parts.clips import load_clips
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from geometry.arrays import Array, rms
from models.humanoid.skeleton import DEFAULT_MASS
from models.mocap.library import embedded_names
from models.mocap.motion.clip import Clip
from sim.body.falls import UP
from sim.body.figure_state import FigureGains
from sim.body.tracking import TrackingConfig, track

BOUNDS = ((1.0, 0.2), (0.5, 0.1), (0.2, 0.04), (0.1, 0.02), (0.05, 0.01))
"""Bounds of the force as a share of body weight, and of the moment as a share of body weight × stature."""

CLIP_SECONDS, PERTURBATIONS = 8.0, (0.0, 1e-6, -1e-6)
RUNS: Mapping[str, tuple[float, Mapping[str, Any]]] = {
    "FOLLOW, pushed": (20.0, {"user": "push"}),
    "rivers, a clip each": (10.0, {"mode": "rivers", "map": "rivers"}),
    "stretch-then-follow": (20.0, {"mode": "stretch-then-follow"}),
    "red-blue composite": (10.0, {"map": "composite", "clips": ("walk", "angry", "cheer")}),
    "walk, run, jump and angry": (20.0, {"clips": ("walk", "run", "jump", "angry")}),
    "LEADING a walk": (20.0, {"mode": "lead"}),
    "LEADING a run": (20.0, {"mode": "lead", "clips": ("run",)}),
    "a run at 0.92 of its pace": (8.0, {"clips": ("run",)}),
    "a walk played too fast": (6.0, {"clips": ("walk",) * 4, "user": "trace", "lap": 2.2}),
    "a jump, pushed": (10.0, {"clips": ("jump",), "user": "push"}),
}
"""Duration [s] and words of each run, by its name in the table."""


def cell(clip: Clip, force: float, moment: float, seconds: float = CLIP_SECONDS) -> str:
    """Number of falls out of all runs, and median residual of the runs that stand [% of body weight]."""
    config = TrackingConfig(gains=FigureGains(force_bound=force, moment_bound=moment))
    reports = [track(Clip(clip.poses, clip.fps * (1.0 + nudge), clip.name), seconds, config) for nudge in PERTURBATIONS]
    fell, residual = sum(bool(one.falls) for one in reports), np.median([one.stance.force_rms for one in reports])
    return f"{fell} of {len(PERTURBATIONS)}, {100 * residual:.1f} %" if fell else f"{100 * residual:.1f} %"


def run_cell(seconds: float, words: Mapping[str, Any], force: float, moment: float) -> str:
    """Number of falls out of all runs; median residual, and largest force and moment of a run [% of their measures]."""
    fell, residuals, most = 0, list[float](), np.zeros(2)
    for nudge in PERTURBATIONS:
        config = run_config(
            **words, seconds=seconds, residual_force=force, residual_moment=moment, mass=DEFAULT_MASS * (1.0 + nudge)
        )
        session = wire(config)
        log = TrialLog(session.servo, session.world)
        session.loop(log).run(seconds)
        frames, measure = log.frames, session.weight * np.array([1.0, config.figure.stature])
        up = frames["down"] == UP
        fell += int(not up.all())
        stance = up & (frames["flight"] == 0.0)
        size = np.array([_norms(frames["residual"][:, :3]), _norms(frames["residual"][:, 3:])]) / measure[:, None]
        residuals.append(rms(size[0, stance]))
        most = np.maximum(most, size[:, up].max(axis=1))
    found = f"{100 * np.median(residuals):.1f} %, {100 * most[0]:.0f} % and {100 * most[1]:.0f} %"
    return f"{fell} of {len(PERTURBATIONS)}, {found}" if fell else found


def _norms(rows: Array) -> Array:
    sizes: Array = np.linalg.norm(rows, axis=1)
    return sizes


def main(names: Sequence[str]) -> None:
    """Print a table."""
    runs = names == ["--runs"]
    print(f"| {'run' if runs else 'clip'} | " + " | ".join(f"{force:g}, {moment:g}" for force, moment in BOUNDS) + " |")
    print("|---" * (1 + len(BOUNDS)) + "|")
    for name, (seconds, words) in RUNS.items() if runs else ():
        cells = (run_cell(seconds, words, *bounds) for bounds in BOUNDS)
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    for name in () if runs else names:
        (clip,), _ = load_clips((name,))
        print(f"| {name} | " + " | ".join(cell(clip, *bounds) for bounds in BOUNDS) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or embedded_names())
