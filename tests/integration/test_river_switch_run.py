"""A lightly pushed hand on the simulated Phantom switches rivers at a crossing, and the other clip plays."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.runs.run import run
from models.mocap.motion.clip import pose_difference
from sim.recording.recording import Recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rivers") / "run"
    run(run_config(mode="rivers", map="rivers", seconds=6.0, user="push"), folder, False, 0.0)
    return folder


def test_river_switch_is_recorded_at_its_time(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    assert "level → wave" in "\n".join(summary["lines"])
    with Recording(folder / "run.h5") as recording:
        river, t = recording.channel("ticks", "river")[:], recording.channel("ticks", "t")[:]
    first = int(np.flatnonzero(np.diff(river))[0])
    assert (river[first], river[first + 1]) == (0.0, 1.0)
    # Half way round the level river.
    assert 1.9 < t[first] < 2.5


def test_animation_has_no_jump_and_the_figure_stands(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    with Recording(folder / "run.h5") as recording:
        reference = recording.channel("frames", "reference")[:]
        period = 1.0 / recording.rates["frames"]
    rate = pose_difference(reference[:-1], reference[1:]) / period
    # Within what a clip does: without inertialisation a joint turns by more than 100 rad/s at a change.
    assert np.abs(rate[:, 6:]).max() < 20.0
    assert np.abs(rate[:, :3]).max() < 2.5
    assert summary["figure"]["fell_at"] is None
    assert summary["figure"]["joint_error_rms_deg"] < 4.0
