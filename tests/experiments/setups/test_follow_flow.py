"""FOLLOW's flow off the curve: how a push across the curve changes the pace of a hand on the simulated Phantom."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.runs.run import run
from geometry.arrays import Array
from sim.recording.recording import Recording
from sim.users.hand.actions import Push


def _angle(out: Path, flow: Literal["curve", "parallel"], user: Literal["push", "relaxed"]) -> Array:
    run(run_config(user=user, figure="none", flow=flow, seconds=7.0), out, True, 0.0)
    with Recording(out / "run.h5") as recording:
        p, off = recording.channel("ticks", "p")[:], recording.channel("ticks", "distance")[:].max()
    assert (off > 7e-3) == (user == "push")
    return np.unwrap(np.arctan2(p[:, 1], p[:, 0]))


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_pushed_hand_keeps_its_angle_only_in_parallel_flow(tmp_path: Path) -> None:
    lag = {
        flow: float(np.abs(_angle(tmp_path, flow, "push") - _angle(tmp_path, flow, "relaxed")).max())
        for flow in ("parallel", "curve")
    }
    assert lag["parallel"] < 0.02
    assert lag["curve"] > 0.1


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize("force", [2.5, -2.5])
def test_slow_hand_keeps_its_pace_in_parallel_flow(tmp_path: Path, force: float) -> None:
    # At 7.5 mm/s a third of the flow's speed compensates for friction, which is the same 8 mm further out or in.
    lap, push = 40.0, Push(at=1.0, seconds=6.0, force=force)
    run(
        run_config(user="push", pushes=(push,), figure="none", flow="parallel", seconds=6.0, lap=lap),
        tmp_path,
        True,
        0.0,
    )
    with Recording(tmp_path / "run.h5") as recording:
        t, p = recording.channel("ticks", "t")[:], recording.channel("ticks", "p")[:]
    pushed = (t > 3.0) & (t < 5.0)
    assert np.abs(np.hypot(p[pushed, 0], p[pushed, 1]).mean() - 0.0477) > 7e-3
    pace = np.polyfit(t[pushed], np.unwrap(np.arctan2(p[pushed, 1], p[pushed, 0])), 1)[0] * lap / (2.0 * np.pi)
    assert pace == pytest.approx(1.0, abs=0.03)
