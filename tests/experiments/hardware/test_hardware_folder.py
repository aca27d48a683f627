"""The folder and summary of a hardware run: one run at a time, and unknown values are marked as unknown."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from controllers.safety.arming import State
from controllers.safety.faults import Fault
from experiments.config.part import to_dict
from experiments.config.run_config import RunConfig
from experiments.hardware.outcome import holds_ticks, outcome_of
from experiments.hardware.run import _write_results, run_folder
from experiments.results.folder import check_folder
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError
from sim.hardware.controls import RunStatus
from sim.hardware.duration_histogram import Quantiles
from sim.hardware.gated_servo import ROW_SIZE, columns
from sim.hardware.servo_process import Ended, Ready
from sim.recording.recorder import Group, Recorder

CONFIG = RunConfig()


def options(out: Path, overwrite: bool = False) -> Any:
    return SimpleNamespace(out=out, overwrite=overwrite)


def record(out: Path, ticks: int) -> None:
    (out / "config.json").write_text("{}")
    with Recorder(out / "run.h5", to_dict(CONFIG), 1, {"ticks": Group(1e3, {"state": ()})}, {}) as recorder:
        if ticks:
            recorder.append("ticks", {"state": np.zeros(ticks)})


def interrupted_run(out: Path, ticks: int | None, overwrite: bool = False, damaged: bool = False) -> None:
    """A run that Ctrl-C ends, with a recording of so many ticks; None: before it has one."""
    with run_folder(options(out, overwrite)) as begin:
        begin()
        if ticks is not None:
            record(out, ticks)
        if damaged:
            (out / "run.h5").write_bytes(b"damaged")
        raise KeyboardInterrupt


def test_concurrent_run_into_the_folder_is_refused(tmp_path: Path) -> None:
    with run_folder(options(tmp_path)) as begin:
        begin()
        record(tmp_path, 3)
        with pytest.raises(SimError, match="another run is being written into it"):
            check_folder(tmp_path, overwrite=True)
        with (
            pytest.raises(SimError, match="another run is being written into it"),
            run_folder(options(tmp_path, overwrite=True)),
        ):
            pass
    assert holds_ticks(tmp_path / "run.h5")
    check_folder(tmp_path, overwrite=True)


def test_earlier_run_survives_until_the_new_one_begins(tmp_path: Path) -> None:
    record(tmp_path, 3)
    earlier = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with run_folder(options(tmp_path, overwrite=True)):
        (tmp_path / "run.h5.new").write_bytes(b"refused before it began")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == earlier
    with run_folder(options(tmp_path, overwrite=True)) as begin:
        (tmp_path / "run.h5.new").write_bytes(b"begun")
        begin()
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"begun"]


@pytest.mark.parametrize("ticks", [None, 0])
def test_run_without_ticks_leaves_no_folder(tmp_path: Path, ticks: int | None) -> None:
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        interrupted_run(out, ticks)
    assert not out.exists()


def test_foreign_files_are_kept(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()
    for file in (tmp_path / "notes.txt", tmp_path / "figures" / "mine.tex"):
        file.write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        interrupted_run(tmp_path, 0, overwrite=True)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["figures", "mine.tex", "notes.txt"]


@pytest.mark.parametrize("damaged", [False, True])
def test_interrupted_or_damaged_recording_is_kept(tmp_path: Path, damaged: bool) -> None:
    with pytest.raises(KeyboardInterrupt):
        interrupted_run(tmp_path, 3, damaged=damaged)
    assert {path.name for path in tmp_path.iterdir()} == {"run.h5", "config.json"}


@pytest.mark.parametrize("ticks", [None, 0])
@pytest.mark.parametrize("watchdog", [True, False])
def test_outcome_of_killed_servo_marks_unknown_values(tmp_path: Path, ticks: int | None, watchdog: bool) -> None:
    if ticks is not None:
        record(tmp_path, ticks)
    outcome = outcome_of(tmp_path / "run.h5", ready(watchdog), None, last_status(alive=False))
    text = "\n".join(outcome.lines())
    assert "their durations and lateness are unknown" in text
    assert "The servo's growth is unknown" in text
    assert ("watchdog switched the motors off" in text) == watchdog
    values = outcome.to_json()
    assert [values[name] for name in ("compute", "lateness", "memory_growth", "descriptors")] == [None] * 4


@pytest.mark.parametrize("alive", [True, False])
def test_servo_that_stopped_before_the_end_is_a_failure(tmp_path: Path, alive: bool) -> None:
    times = Quantiles(0.0, 0.0, 0.0, 0.0, 3)
    ended = Ended(3, 4000, times, times, 0.0, 0)  # it answered in the end, as after a read that blocked
    outcome = outcome_of(tmp_path / "run.h5", ready(), ended, last_status(alive))
    assert outcome.sound == alive
    assert ("The servo stopped before the end of the run." in outcome.lines()) == (not alive)


def test_remarks_are_in_the_summary(tmp_path: Path) -> None:
    record(tmp_path, 3)
    outcome = outcome_of(tmp_path / "missing.h5", ready(), None, last_status(alive=True))  # draws no page
    _write_results(outcome, ("legs are the first clip's",), tmp_path, Console(quiet=True))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["remarks"] == ["legs are the first clip's"]
    assert summary["lines"] == outcome.lines()


def ready(watchdog: bool = True) -> Ready:
    return Ready(DeviceIdentity("arm", "usb", "", "", forces=True, watchdog=watchdog, calibrated=True), 1e-3, [])


def last_status(alive: bool) -> RunStatus:
    row = {name: channel[0] for name, channel in columns(np.zeros((1, ROW_SIZE))).items()}
    return RunStatus(alive, State.ACTIVE, Fault.NONE, 0.0, row, None)
