"""FOLLOW leads a robot arm through the same loop, map and device as it does the figure."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from experiments.cli import main
from experiments.config.part import from_file
from experiments.config.run_config import ArmConfig
from experiments.setups.robot_arm import HOME, SCALE, wire_arm
from models.world.scene import PEDESTAL
from sim.loop.loop import Loop
from sim.recording.recording import Recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm") / "run"
    assert main(["arm", "--seconds", "8", "--out", str(folder)]) == 0
    return folder


@pytest.mark.slow
def test_the_tool_follows_the_scaled_curve_and_yields_to_the_hand(folder: Path) -> None:
    with Recording(folder / "run.h5") as recording:
        t, tool = recording.channel("frames", "t")[:], recording.channel("frames", "tool")[:]
        curve = HOME + [0.0, 0.0, PEDESTAL] + SCALE * recording.array("curve")
    away = np.array([np.linalg.norm(curve - place, axis=1).min() for place in tool])
    alone = (t > 1.0) & (t < 4.4)
    assert away[alone].max() < 2.0e-3  # the curve is drawn with a point every 2 mm
    assert away[(t > 4.4) & (t < 6.0)].max() > 8.0e-3


@pytest.mark.slow
def test_the_arm_is_where_the_map_has_it_with_torque_to_spare(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["tool_rms_mm"] < 0.2
    assert summary["tool_max_mm"] < 0.5
    assert summary["joints_rms_deg"] < 0.05
    assert summary["torque_share"] < 0.3
    assert summary["nearest_limit_deg"] > 20.0
    assert (folder / "report.html").exists()
    assert (folder / "arm.png").exists()


@pytest.mark.slow
def test_it_is_reproduced_bit_for_bit(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert from_file(ArmConfig, folder / "config.json") == ArmConfig(seconds=8.0)
    assert main(["reproduce", str(folder)]) == 0
    assert "bit for bit, over 8000 ticks" in capsys.readouterr().out
    page = (folder / "report.html").read_text(encoding="utf-8")
    (folder / "report.html").unlink()
    assert main(["report", str(folder)]) == 0
    assert (folder / "report.html").read_text(encoding="utf-8") == page
    altered = tmp_path / "altered"
    shutil.copytree(folder, altered)
    with h5py.File(altered / "run.h5", "r+") as file:
        config = json.loads(file["config"][()])
        del file["config"]
        file["config"] = json.dumps(config | {"stiffness": 301.0})
    assert main(["reproduce", str(altered)]) == 1
    assert "differs first at" in capsys.readouterr().out


@pytest.mark.slow
def test_a_weak_motor_gives_way_at_its_limit_and_says_so() -> None:
    """The tracking above is the motors' doing: with a tenth of the shoulder's torque the arm hangs behind."""
    servo, world, _ = wire_arm(ArmConfig(seconds=1.5, user="relaxed"))
    servo.figure.torque_limit[1] = 10.0
    Loop(servo, world).run(0.5)
    assert abs(servo.figure.ctrl[1]) <= 10.0
    assert servo.figure.report[1] >= 1.0
    assert np.abs(servo.figure.qpos - servo.reference.pose).max() > 0.1


def test_bad_numbers_are_one_line_and_exit_code_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for flags in (["--seconds", "0"], ["--arm-ticks", "0"], ["--radius", "0.5"], ["--lap", "nan"]):
        assert main(["arm", *flags, "--out", str(tmp_path / "run")]) == 2
        assert "Traceback" not in capsys.readouterr().err
        assert not (tmp_path / "run").exists()
