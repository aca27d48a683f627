"""Ground contact of the physical figure in the summary of a run, against an independent count."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.runs.run import run
from models.humanoid.skeleton import FOOT_CONTACTS, figure_model
from sim.body.falls import UP
from sim.body.figure_state import FigureGains
from sim.recording.recording import Recording


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_grounded_share_matches_independent_count(tmp_path: Path) -> None:
    summary = run(run_config(clips=("run",), lap=2.2, seconds=4.0), tmp_path / "run", False, 0.0)
    with Recording(tmp_path / "run" / "run.h5") as recording:
        reference, ground = recording.channel("frames", "reference")[:], recording.channel("frames", "ground")[:]
        up = recording.channel("frames", "down")[:] == UP
    model = figure_model()
    data, stands = mujoco.MjData(model), np.empty(len(reference), dtype=bool)
    for k, pose in enumerate(reference):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        lowest = min(data.geom(name).xpos[2] - model.geom(name).size[0] for name in FOOT_CONTACTS)
        stands[k] = lowest <= FigureGains().flight_height
    assert 0.2 < np.mean(stands) < 0.95
    grounded = np.mean(ground[stands & up, 2] > 1.0)
    assert summary.figure is not None
    assert summary.figure.grounded == pytest.approx(grounded, abs=1e-3)
    assert summary.figure.lost_contact_seconds == pytest.approx((1.0 - grounded) * np.sum(stands & up) * 2e-3, rel=0.02)
