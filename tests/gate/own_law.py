"""A run with a law in plain Python, for the gate: ``python tests/gate/own_law.py FOLDER`` writes its recording."""

import sys
from pathlib import Path

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.weights import Weight
from controllers.fields.follow import Follow
from controllers.fields.own.python_law import PythonLaw
from controllers.state import HandState
from experiments.config.words import run_config
from sim.loop.loop import groups, record_into
from sim.recording.recorder import Recorder
from tests.loop_with_law import loop_with


def wall(hand: HandState) -> np.ndarray:
    depth = -0.001 - hand.p[2]
    return np.array([0.0, 0.0, max(0.0, 500.0 * depth - 3.0 * hand.v[2])]) if depth > 0.0 else np.zeros(3)


def main(out: Path) -> None:
    river = Follow(Trajectory.circle(0.0477, 4.0), k_r=300.0, b_d=4.0)
    field = (river + PythonLaw(wall).gated(Weight.speed(0.0, 0.01))).limited(6.0)
    config = run_config(clips=("cheer", "angry"), seconds=1.0)
    session, loop = loop_with(config, field, lambda ticks, frames, n: record(ticks, frames, n))
    out.mkdir(parents=True)
    with Recorder(out / "run.h5", {}, 1, groups(session.servo), {}) as recorder:
        record = record_into(recorder, session.servo, session.world)
        loop.run(config.seconds)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
