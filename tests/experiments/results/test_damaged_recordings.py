"""Recordings that are cut short or lack rows, channels or frames are refused in one line by commands that read them."""

import shutil
from pathlib import Path

import h5py
import pytest

from tests.experiments.refused_command import refused


@pytest.fixture
def spoiled(run_folder: Path, tmp_path: Path) -> Path:
    """A copy of the run to spoil."""
    return shutil.copytree(run_folder, tmp_path / "run")


READERS = (["report"], ["reproduce"], ["certify"], ["render"], ["picture"])


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader[0])
def test_truncated_recording_is_refused(
    reader: list[str], spoiled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (spoiled / "run.h5").write_bytes((spoiled / "run.h5").read_bytes()[:200_000])
    target = [str(tmp_path / "x.png")] if reader == ["picture"] else []
    stderr = refused([*reader, str(spoiled), *target], capsys)
    assert "run.h5: not a recording, cut short: 200000 bytes of " in stderr


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader[0])
def test_recording_with_missing_rows_is_refused_with_the_channel(
    reader: list[str], spoiled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(spoiled / "run.h5", "r+") as file:
        file["ticks/force"].resize(100, axis=0)
    target = [str(tmp_path / "x.png")] if reader == ["picture"] else []
    stderr = refused([*reader, str(spoiled), *target], capsys)
    assert "run.h5: not a recording, or damaged (ticks/force has 100 rows, ticks/rows says 1000)" in stderr


@pytest.mark.parametrize(
    ("missing", "message"),
    [("static/curve", "no array or text curve; there are"), ("ticks/p", "no channel ticks/p; there are")],
)
def test_missing_channel_or_array_is_named(
    missing: str, message: str, spoiled: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(spoiled / "run.h5", "r+") as file:
        del file[missing]
    assert f"run.h5: {message}" in refused(["report", str(spoiled)], capsys)


def test_recording_with_missing_frames_is_not_reproduced(spoiled: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with h5py.File(spoiled / "run.h5", "r+") as file:
        for name in ("t", "qpos"):
            file["frames"][name].resize(100, axis=0)
        file["frames/rows"][0] = 100
    assert "run.h5: damaged: it has 100 frames; expected 500 for 1000 ticks" in refused(
        ["reproduce", str(spoiled)], capsys
    )
