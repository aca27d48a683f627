"""Progress of long commands: time left, and stored durations."""

import time
from pathlib import Path

from experiments.console.progress import remaining_text, working


def test_time_left_is_stored_duration_minus_elapsed_time() -> None:
    assert remaining_text(12.0, 30.0) == "12 s, about 18 s left"
    assert remaining_text(12.4, None) == "12 s"
    assert "longer" in remaining_text(31.0, 30.0)


def test_command_durations_are_stored_and_a_corrupt_file_is_ignored(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr("experiments.console.progress._MIN_STORED_DURATION", 0.01)
    file = tmp_path / "hvf" / "durations.json"
    with working("waiting", share=2.0):
        time.sleep(0.05)
    assert '"waiting": 0.0' in file.read_text()
    file.write_text("[")
    with working("waiting"):
        time.sleep(0.02)
    assert "waiting" in file.read_text()
