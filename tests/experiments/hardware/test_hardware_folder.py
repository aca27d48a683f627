"""The folder of a hardware run: one run at a time writes into it, and one that recorded nothing leaves nothing."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.config.part import to_dict
from experiments.config.run_config import RunConfig
from experiments.hardware.outcome import holds_ticks
from experiments.hardware.run import run_folder
from experiments.results.folder import check_folder
from sim.errors import SimError
from sim.recording.recorder import Group, Recorder

CONFIG, CONTENT = RunConfig(), {"format": "hvf-device-1"}


def options(out: Path, overwrite: bool = False) -> Any:
    return SimpleNamespace(out=out, overwrite=overwrite)


def record(out: Path, ticks: int) -> None:
    with Recorder(out / "run.h5", to_dict(CONFIG), 1, {"ticks": Group(1e3, {"state": ()})}, {}) as recorder:
        if ticks:
            recorder.append("ticks", {"state": np.zeros(ticks)})


def stopped(out: Path, ticks: int | None, overwrite: bool = False, damaged: bool = False) -> None:
    """A run that Ctrl-C ends once it has made its recording, or before, with so many ticks."""
    with run_folder(CONFIG, CONTENT, options(out, overwrite)):
        if ticks is not None:
            record(out, ticks)
        if damaged:
            (out / "run.h5").write_bytes(b"damaged")
        raise KeyboardInterrupt


def test_no_other_run_is_written_into_it_meanwhile(tmp_path: Path) -> None:
    with run_folder(CONFIG, CONTENT, options(tmp_path)):
        record(tmp_path, 3)
        with pytest.raises(SimError, match="another run is being written into it"):
            check_folder(tmp_path, overwrite=True)
        with (
            pytest.raises(SimError, match="another run is being written into it"),
            run_folder(CONFIG, CONTENT, options(tmp_path, overwrite=True)),
        ):
            pass
    assert holds_ticks(tmp_path / "run.h5")
    check_folder(tmp_path, overwrite=True)


@pytest.mark.parametrize("ticks", [None, 0])
def test_a_run_that_recorded_nothing_leaves_nothing(tmp_path: Path, ticks: int | None) -> None:
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        stopped(out, ticks)
    assert not out.exists()


def test_what_is_of_somebody_else_stays(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()
    for mine in (tmp_path / "notes.txt", tmp_path / "figures" / "mine.tex"):
        mine.write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        stopped(tmp_path, 0, overwrite=True)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["figures", "mine.tex", "notes.txt"]


@pytest.mark.parametrize("damaged", [False, True])
def test_what_was_recorded_until_an_interrupt_or_cannot_be_read_is_kept(tmp_path: Path, damaged: bool) -> None:
    with pytest.raises(KeyboardInterrupt):
        stopped(tmp_path, 3, damaged=damaged)
    assert {path.name for path in tmp_path.iterdir()} == {"run.h5", "config.json", "run-device.json"}
