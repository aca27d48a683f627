"""Picture of hands with and without a soft wall: ``python -m experiments.studies.wall_trials docs/pictures``."""

import sys
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from experiments.config.options import run_config
from experiments.files.figure_files import save_figure
from experiments.results.pages.figures import PLAIN_STYLE
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from geometry.arrays import Array
from geometry.rotations import exponential, multiply
from models.humanoid.skeleton import JOINTS, N_POSE
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.motion.ranges import beyond_ranges
from sim.users.hand.actions import Push
from sim.viewer.palette import CURVE, FIELD, USER

_RUN_DURATION = 6.0  # of a run
BENT_JOINT, BENT_ROTATION = "left_elbow", (0.0, 0.0, np.radians(160.0))  # a joint, and a rotation beyond its limits


def with_broken_elbow(clip: Clip) -> Clip:
    """The clip with its left elbow bent the wrong way."""
    poses = clip.poses.copy()
    column = N_POSE - 4 * (len(JOINTS) - JOINTS.index(BENT_JOINT))
    turn = exponential(*BENT_ROTATION)
    poses[:, column : column + 4] = [multiply(q[0], q[1], q[2], q[3], *turn) for q in poses[:, column : column + 4]]
    return Clip(poses, clip.fps, f"{clip.name} with a broken elbow")


class WallRun(NamedTuple):
    """A hand that pushes towards an impossible clip: time [s], radius of the stylus [m], excess [rad]."""

    t: Array
    radius: Array
    excess: Array


def pushed_run(walls: bool) -> WallRun:
    """Run a hand that pushes outwards, towards the clip with the wrong elbow, in the second half of a lap."""
    inside = embedded("squat_dance")
    config = run_config(seconds=_RUN_DURATION, walls=walls, pushes=(Push(2.0, 3.0, 2.5),))
    session = wire(config, (inside, with_broken_elbow(inside)))
    log = TrialLog(session.servo, session.world)
    session.loop(log).run(_RUN_DURATION)
    x, y, _ = log.ticks["p"][:: session.servo.figure_ticks].T
    return WallRun(log.frames["t"], np.hypot(x, y), beyond_ranges(log.frames["reference"]).max(axis=1))


def wall_figure(without: WallRun, with_walls: WallRun) -> Figure:
    """Radius of the stylus and worst joint over time, without walls and with them."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    radius, worst = figure.subplots(1, 2)
    for run, color, label in ((without, USER, "without walls"), (with_walls, FIELD, "with walls")):
        radius.plot(run.t, 1e3 * run.radius, color=color, label=label)
        worst.plot(run.t, np.degrees(run.excess), color=color, label=label)
    radius.set(xlabel="time [s]", ylabel="radius of the stylus [mm]", title="the hand pushes outwards from 2 s to 5 s")
    worst.axhline(0.0, color=CURVE, lw=0.8, ls="--")
    worst.set(xlabel="time [s]", ylabel="beyond the limit [°]", title="the worst joint of the figure")
    radius.legend()
    return figure


if __name__ == "__main__":
    with mpl.rc_context(PLAIN_STYLE):
        drawing = wall_figure(pushed_run(walls=False), pushed_run(walls=True))
        save_figure(drawing, Path(sys.argv[1]) / "soft-walls.png", dpi=150)
