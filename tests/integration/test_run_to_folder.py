"""A run from the command line to its folder: files, measures, and exact reproduction."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from experiments.cli import main
from models.mocap.library import load_clip
from sim.recording.recording import Recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "pushed"
    assert main(["run", "--clips", "cheer", "angry", "--user", "push", "--seconds", "9", "--out", str(out)]) == 0
    return out


def test_run_writes_all_files(folder: Path) -> None:
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    figures = {f"figures/{name}.png" for name in ("path", "deviation", "forces", "torques", "figure")}
    assert names == {"run.h5", "summary.json", "config.json", "report.html", "edited.bvh", "default.bvh"} | figures


def test_relaxed_hand_stays_within_1_mm_of_the_curve(folder: Path) -> None:
    path = json.loads((folder / "summary.json").read_text())["path"]
    assert path["deviation_rms_mm"] <= 1.0


def test_deviation_follows_the_push(folder: Path) -> None:
    pushes = json.loads((folder / "summary.json").read_text())["path"]["pushes"]
    assert len(pushes) == 2
    for push in pushes:
        assert push["deviation_mm"] > 5.0
        assert push["along_push"] > 0.95


def test_animation_differs_only_where_pushed(folder: Path) -> None:
    """Both files have the same times, so that differences come from the hand."""
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["animation"]["pushed_deg"] > 5.0
    assert summary["animation"]["unpushed_deg"] < 1.0
    edited, default = load_clip(folder / "edited.bvh"), load_clip(folder / "default.bvh")
    assert edited.n_frames == default.n_frames
    assert edited.fps == pytest.approx(50.0)
    assert edited.fps == default.fps
    t = np.arange(edited.n_frames) / edited.fps
    difference = np.linalg.norm(edited.poses[:, 7:] - default.poses[:, 7:], axis=1)
    pushes = summary["path"]["pushes"]
    pushed = np.any([(t > p["start"]) & (t < p["start"] + p["seconds"]) for p in pushes], axis=0)
    near = np.any([(t > p["start"] - 0.05) & (t < p["start"] + p["seconds"] + 1.0) for p in pushes], axis=0)
    assert difference[pushed].max() > 10.0 * difference[~near & (t > 1.0)].max()


def test_physical_figure_follows_without_warnings(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["warnings"] == {}
    assert summary["figure"]["residual_in_flight_max"] == 0.0
    assert summary["figure"]["root_error_max_cm"] < 5.0


@pytest.mark.usefixtures("without_region")
def test_run_is_certified_with_its_clips(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["certify", str(folder), "--no-hand", "--out", str(tmp_path)]
    assert main([*command, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["stability"]["verdict"] == "certified"
    assert result["ballistic"]["verdict"] == "certified"
    assert set(result["ballistic"]["figures"]["clips"]) == {"cheer", "angry", "as played"}
    assert main([*command, "--verify", str(tmp_path / "certificate.json")]) == 0
    assert main(["certify", "--no-hand", "--verify", str(tmp_path / "certificate.json")]) == 1
    assert "changed: clips;" in capsys.readouterr().err


@pytest.mark.usefixtures("without_page")
@pytest.mark.parametrize("figure", ["kinematic", "none"])
def test_run_without_physical_figure_is_reproduced(
    figure: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "run")
    assert main(["run", "--figure", figure, "--seconds", "1", "--out", out]) == 0
    assert ("The clips were played at" in capsys.readouterr().out) == (figure == "kinematic")
    assert main(["reproduce", out]) == 0


def test_run_is_reproduced_exactly_from_its_recording(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", str(folder)]) == 0
    assert "bit for bit, over 9000 ticks" in capsys.readouterr().out


def test_recording_with_altered_gain_is_not_reproduced(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The comparison can fail: a recording whose configuration is altered is not the same."""
    import shutil

    import h5py

    altered = tmp_path / "altered"
    shutil.copytree(folder, altered)
    with h5py.File(altered / "run.h5", "r+") as file:
        config = json.loads(file["config"][()])
        del file["config"]
        config["mode"]["stiffness"] = 301.0
        file["config"] = json.dumps(config)
    assert main(["reproduce", str(altered)]) == 1
    assert "differs first at tick" in capsys.readouterr().out


def test_killed_run_keeps_its_recording_and_can_be_reported(tmp_path: Path) -> None:
    out = tmp_path / "killed"
    options = ["--clips", "cheer", "--figure", "kinematic", "--seconds", "600", "--out", str(out)]
    command = [sys.executable, "-m", "experiments.cli", "run", *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(600):
        time.sleep(0.5)
        if (out / "run.h5").exists() and (out / "run.h5").stat().st_size > 3e6:
            break
    process.send_signal(signal.SIGKILL)
    process.wait()
    with Recording(out / "run.h5") as recording:
        assert not recording.complete
        recorded = len(recording.channel("ticks", "t"))
        assert recorded > 1000
        assert len(recording.channel("frames", "t")) * 2 == recorded
    assert main(["report", str(out)]) == 0
    assert "The run was stopped: " in (out / "report.html").read_text(encoding="utf-8")
    assert json.loads((out / "summary.json").read_text())["path"]["laps"] == pytest.approx(recorded / 4000.0, rel=0.2)
    edited, default = load_clip(out / "edited.bvh"), load_clip(out / "default.bvh")
    assert edited.n_frames == default.n_frames == pytest.approx(recorded / 20, abs=1)
