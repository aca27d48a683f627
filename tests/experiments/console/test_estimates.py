"""Time and disk space that a long run is announced with."""

from pathlib import Path

import pytest


def test_long_run_is_announced_with_time_and_disk_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.console import estimates
    from sim.recording.recorder import Group

    monkeypatch.setattr(estimates, "expected_seconds", lambda what: 0.25)
    groups = {"ticks": Group(1000.0, {"x": (100,)})}
    announcement = estimates.cost_estimate(tmp_path, 86400.0 / 24, groups)
    assert announcement is not None
    assert announcement.startswith(
        "3600 s of simulated time take about 15 minutes at the speed of the last run, and 2.88 GB of"
    )
    assert estimates.cost_estimate(tmp_path, 10.0, groups) is None
