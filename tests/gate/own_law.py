"""A run with a law in plain Python, for the gate: ``python tests/gate/own_law.py FOLDER`` writes its recording.

It runs in the tree of an earlier commit, too: laws come from `hvf`, whose names stay where modules move.
"""

import sys
from pathlib import Path

import numpy as np

import hvf
from experiments.config.options import run_config
from sim.loop.channels import groups, record_into
from sim.recording.recorder import Recorder
from tests.loop_with_law import loop_with


@hvf.law
def wall(hand: hvf.HandState) -> np.ndarray:
    depth = -0.001 - hand.p[2]
    return np.array([0.0, 0.0, max(0.0, 500.0 * depth - 3.0 * hand.v[2])]) if depth > 0.0 else np.zeros(3)


def main(out: Path) -> None:
    river = hvf.Follow(hvf.Trajectory.circle(0.0477, 4.0), k_r=300.0, b_d=4.0)
    field = (river + wall.gated(hvf.Weight.speed(0.0, 0.01))).limited(6.0)
    config = run_config(clips=("cheer", "angry"), seconds=1.0)
    session, loop = loop_with(config, field, lambda ticks, frames, n: record(ticks, frames, n))
    out.mkdir(parents=True)
    with Recorder(out / "run.h5", {}, 1, groups(session.servo, session.world), {}) as recorder:
        record = record_into(recorder, session.servo, session.world)
        loop.run(config.seconds)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
