"""FOLLOW's flow off the curve: how a push across the curve changes the pace of a hand on the simulated Phantom."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.runs.run import run
from geometry.arrays import Array
from sim.recording.recording import Recording


def _angle(out: Path, flow: Literal["curve", "parallel"], user: Literal["push", "relaxed"]) -> Array:
    run(run_config(user=user, figure="none", flow=flow, seconds=7.0), out, True, 0.0)
    with Recording(out / "run.h5") as recording:
        p, off = recording.channel("ticks", "p")[:], recording.channel("ticks", "distance")[:].max()
    assert (off > 7e-3) == (user == "push")
    return np.unwrap(np.arctan2(p[:, 1], p[:, 0]))


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_pushed_hand_keeps_its_angle_only_in_parallel_flow(
    tmp_path: Path,
) -> None:
    lag = {
        flow: float(np.abs(_angle(tmp_path, flow, "push") - _angle(tmp_path, flow, "relaxed")).max())
        for flow in ("parallel", "curve")
    }
    assert lag["parallel"] < 0.02
    assert lag["curve"] > 0.1
