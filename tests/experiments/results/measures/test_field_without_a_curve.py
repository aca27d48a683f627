"""Summary of a run whose field has no curve: distances from a curve are absent."""

import numpy as np
import pytest

import hvf

CURVE = hvf.circle(lap=4.0)
PUSH = hvf.Push(at=0.1, seconds=1.0, force=1.0, direction=(1, 0, 0))


@hvf.law(compiled=True)
def still(hand, k=200.0, b=4.0):
    x, y, z = hand.p[0] - 0.0477, hand.p[1], hand.p[2]
    return (-k * x - b * hand.v[0], -k * y - b * hand.v[1], -k * z - b * hand.v[2])


def test_push_is_measured_from_its_start_if_there_is_no_curve() -> None:
    sim = hvf.Simulation(
        field=still, haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=CURVE), figure=hvf.Figure(kind="none"),
        user=hvf.User(pushes=[PUSH]),
    )  # fmt: skip
    run = sim.run(2.2)
    p, path = run.ticks["p"], run.summary.path
    moved = 1e3 * np.linalg.norm(p[100:1100] - p[101], axis=1).max()
    assert path.pushes[0].deviation_mm == pytest.approx(moved, abs=1e-3)
    assert 3.0 < path.pushes[0].deviation_mm < 6.0
    assert path.pushes[0].along_push == pytest.approx(1.0, abs=0.01)
    assert (path.deviation_max_mm, path.deviation_rms_mm, path.pace) == (None, None, None)
