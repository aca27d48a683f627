"""Atomic writing of files: an unfinished file is never visible, and an interrupt keeps the old content."""

import errno
import resource
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from experiments.cli import main
from experiments.files.device_files import save_device
from experiments.files.figure_files import save_figure
from experiments.files.map_files import write_arrays
from experiments.lifting import lift_report
from geometry import whole_files as whole
from geometry.whole_files import atomic_file, write_text
from models.mocap.library import embedded
from models.mocap.readers.own_bvh import write_bvh


def test_file_appears_only_once_closed(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    path.write_bytes(b"old")
    with atomic_file(path) as file:
        file.write(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode == (_plain(tmp_path / "plain")).stat().st_mode
    assert len(list(tmp_path.iterdir())) == 2


def _plain(path: Path) -> Path:
    path.write_bytes(b"")
    return path


def test_symbolic_link_is_preserved(tmp_path: Path) -> None:
    path, link = _plain(tmp_path / "device.json"), tmp_path / "link.json"
    link.symlink_to(path)
    save_device({"format": 1}, link)
    assert link.is_symlink()
    assert path.read_text(encoding="utf-8").startswith("{")


def _interrupted(path: Path, interruption: Any) -> None:
    with atomic_file(path) as file:
        file.write(b"half")
        raise interruption


@pytest.mark.parametrize(
    "interruption", [KeyboardInterrupt, MemoryError, OSError(errno.ENOSPC, "No space left on device")]
)
@pytest.mark.parametrize("before", [None, b"old"])
def test_interrupted_write_keeps_the_old_content(tmp_path: Path, before: bytes | None, interruption: Any) -> None:
    path = tmp_path / "map.npz"
    if before is not None:
        path.write_bytes(before)
    with pytest.raises(interruption if isinstance(interruption, type) else OSError):
        _interrupted(path, interruption)
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == ([] if before is None else [before])


def _write_plot(path: Path) -> None:
    save_figure(Figure(), path)


def _write_clip(path: Path) -> None:
    write_bvh(embedded("walk"), path)


def _write_gltf_clip(path: Path) -> None:
    pytest.importorskip("pygltflib")
    from experiments.export.gltf import write_gltf

    write_gltf(embedded("walk"), path)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("report.html", lambda path: write_text(path, "new" * 1000)), ("clip.bvh", _write_clip),
        ("clip.glb", _write_gltf_clip), ("plot.png", _write_plot),
    ],
)  # fmt: skip
def test_content_for_which_the_disk_is_too_small_leaves_the_old_file(
    tmp_path: Path, name: str, write: Callable[[Path], None]
) -> None:
    path, limits = tmp_path / name, resource.getrlimit(resource.RLIMIT_FSIZE)
    write_text(path, "old")
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large") as refused:
            write(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert refused.value.filename == str(path)
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_interrupted_archive_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(whole.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_arrays(tmp_path / "map.npz", {"a": np.zeros(3)})
    assert not list(tmp_path.iterdir())


def test_interrupted_lift_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    def nothing(*_: object) -> None:
        return None

    monkeypatch.setattr(lift_report, "lift_clips", nothing)
    monkeypatch.setattr(lift_report, "report_lift", interrupted)
    with pytest.raises(KeyboardInterrupt):
        lift_report.lift_into(["walk"], tmp_path / "maps" / "map.npz")
    assert main(["lift", "walk", "--out", str(tmp_path / "map.npz")]) == 130
    assert capsys.readouterr().err.strip() == "hvf: stopped; no partial files are left"
    assert not list(tmp_path.iterdir())
