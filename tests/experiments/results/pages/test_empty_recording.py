"""The report of a recording without rows is refused, and leaves nothing behind."""

from pathlib import Path

import numpy as np
import pytest

from experiments.results.pages.report import write_report_of
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import RecordingError


@pytest.mark.parametrize("groups", [{"ticks"}, {"ticks", "frames"}])
def test_report_of_an_empty_recording_leaves_no_folder(tmp_path: Path, groups: set[str]) -> None:
    channels = {"t": (), "p": (3,), "user": (3,), "force": (3,)}
    static = {"title": "run", "hand_does": "relaxed", "curve": np.zeros((2, 3)), "tube_radius": 0.0}
    made = {group: Group(1e3, channels) for group in groups}
    with Recorder(tmp_path / "run.h5", {}, 1, made, static) as recorder:
        recorder.close({"lines": []})
    with pytest.raises(RecordingError, match="has no rows"):
        write_report_of(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]
