"""Time and disk space that a long run is announced with."""

from pathlib import Path

import pytest

from controllers.errors import ParameterError
from experiments.console import estimates
from sim.recording.recorder import Group


def test_long_run_is_announced_with_time_and_disk_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimates, "expected_seconds", lambda what: 0.25)
    groups = {"ticks": Group(1000.0, {"x": (100,)})}
    announcement = estimates.cost_estimate(tmp_path, 86400.0 / 24, groups)
    assert announcement is not None
    assert announcement.startswith(
        "3600 s of simulated time take about 15 minutes at the speed of the last run, and 2.88 GB of"
    )
    assert estimates.cost_estimate(tmp_path, 10.0, groups) is None


def test_recording_that_does_not_fit_is_refused_with_what_is_free_for_it(tmp_path, monkeypatch) -> None:
    for free, message in ((2.0, "0 MB are free for it where .*; expected another --out"), (4.1, "less than 0.25 s")):
        monkeypatch.setattr(estimates, "_free_bytes", lambda out, free=free: 1e6 * free)
        with pytest.raises(ParameterError, match=message):
            estimates.check_length(tmp_path, 0.5, 1e-3)
