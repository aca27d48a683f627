"""Ctrl-C during a command: what was computed is kept, and stderr says how to continue."""

import contextlib
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.cli import main
from experiments.trials.study import DATABASE
from sim.recording.recording import Recording
from tests.experiments.own_process import default_interrupt, stderr_of_interrupted

WHERE_INTERRUPTS_ARE_LOST = {
    "import": "import interrupted",  # which would turn it into another error
    "destructor": """
class Last:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)

Last()
""",
    "nowhere": "os.kill(os.getpid(), signal.SIGINT)",
}


@pytest.mark.parametrize("lost", WHERE_INTERRUPTS_ARE_LOST)
def test_interrupt_that_would_be_lost_is_raised_a_little_later(lost: str, tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(
        "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n    done = True\n"
        "except KeyboardInterrupt:\n    raise ImportError('initialization failed') from None\n"
    )
    script = f"""
import os, signal, time
from experiments.console import startup
startup.handle_interrupts()
try:
    {WHERE_INTERRUPTS_ARE_LOST[lost].strip().replace(chr(10), chr(10) + "    ")}
    time.sleep(60.0)
except KeyboardInterrupt:
    print("stopped")
"""
    completed = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, preexec_fn=default_interrupt,
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": os.pathsep.join([str(Path.cwd()), str(tmp_path)])}, check=False,
    )  # fmt: skip
    assert (completed.stdout, completed.stderr) == ("stopped\n", "")


@pytest.mark.slow
def test_ctrl_c_leaves_a_valid_recording_and_names_the_next_command(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ["run", "--figure", "none", "--seconds", "2000", "--out", str(out)]
    stderr = stderr_of_interrupted(words, (out / "run.h5").exists, wait=0.5)
    assert f"hvf report {out}" in stderr.replace("\n", " ")
    with Recording(out / "run.h5") as recording:
        assert not recording.complete
        assert len(recording.channel("ticks", "t")) > 500
    assert main(["report", str(out)]) == 0
    assert "The run was stopped: " in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "summary.json").exists()


STUDY = """name = "Stopped"
seconds = 2.0
repetitions = 6
[run]
figure = "none"
[users]
number = 4
[factors]
stiffness = [100, 300]
"""


@pytest.mark.slow
def test_ctrl_c_keeps_finished_trials_and_the_study_resumes(tmp_path: Path) -> None:
    pytest.importorskip("statsmodels", reason="needs the study extra")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    words = ["trials", str(tmp_path / "study.toml"), "--out", str(tmp_path / "study")]
    database = f"file:{tmp_path / 'study' / DATABASE}?mode=ro"

    def stored_trials() -> int:
        with contextlib.suppress(sqlite3.OperationalError), sqlite3.connect(database, uri=True) as rows:
            return rows.execute("select count(*) from trials").fetchone()[0]
        return 0

    stderr = stderr_of_interrupted(words, lambda: stored_trials() > 0, wait=0.0)
    assert "the same command resumes" in stderr
    assert str(tmp_path / "study") in stderr
    before = stored_trials()
    assert 0 < before < 48
    assert main(words) == 0
    assert stored_trials() == 48
