"""What the command says of itself: the next step, how long it takes, how to go on after Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.cli import main, parsed
from experiments.welcome import WELCOME
from experiments.working import left, working
from sim.recording.recording import Recording


def test_without_a_word_it_says_what_to_do_next_and_every_command_it_names_is_one(capsys) -> None:
    assert main([]) == 0
    said = capsys.readouterr().out
    assert said == WELCOME + "\n"
    for line in said.splitlines():
        if line.startswith("  hvf "):
            assert callable(parsed(line.strip().split("  ")[0].split()[1:])), line


def test_time_left_is_that_of_the_last_time_less_what_has_gone() -> None:
    assert left(12.0, 30.0) == "12 s, about 18 s left"
    assert left(12.4, None) == "12 s"
    assert "longer" in left(31.0, 30.0)


def test_what_took_long_is_kept_and_a_broken_file_is_no_hindrance(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("HVF_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr("experiments.working._WORTH_KEEPING", 0.01)
    file = tmp_path / "hvf" / "durations.json"
    with working("waiting", share=2.0):
        time.sleep(0.05)
    assert '"waiting": 0.0' in file.read_text()
    file.write_text("[")
    with working("waiting"):
        time.sleep(0.02)
    assert "waiting" in file.read_text()


def _hear() -> None:
    """A command that is begun in the background of a shell would not hear Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.slow
def test_ctrl_c_leaves_a_valid_recording_and_says_how_to_go_on(tmp_path: Path) -> None:
    out = tmp_path / "run"
    command = [sys.executable, "-m", "experiments.cli", "run", "--figure", "none", "--seconds", "2000", "--out"]
    process = subprocess.Popen(
        [*command, str(out)], stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=_hear
    )
    deadline = time.monotonic() + 120.0
    while not (out / "run.h5").exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.5)
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130, said
    assert f"hvf report {out}" in said.replace("\n", " ")
    with Recording(out / "run.h5") as recording:
        assert not recording.complete
        assert len(recording.channel("ticks", "t")) > 500
    assert main(["report", str(out)]) == 0
    assert "The run was stopped: " in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "summary.json").exists()
