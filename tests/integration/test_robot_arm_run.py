"""Fields drive a robot arm through the same loop and device as the figure."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import hvf
from experiments.cli import main
from experiments.config.options import run_config
from experiments.config.paths import load_config
from experiments.results.pages.report import write_report_of
from experiments.setups.maps.robot_arm import HOME
from experiments.setups.parts.defaults import resolved
from experiments.setups.wiring import wire
from models.world.scene import PEDESTAL
from sim.body.robot import RobotState
from sim.loop.channels import channels
from sim.loop.loop import Loop
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recording import Recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm") / "run"
    assert main(["run", "--map", "robot-arm", "--user", "push", "--seconds", "8", "--out", str(folder)]) == 0
    return folder


@pytest.mark.slow
def test_tool_follows_the_scaled_curve_and_yields_to_the_hand(folder: Path) -> None:
    with Recording(folder / "run.h5") as recording:
        t, tool = recording.channel("frames", "t")[:], recording.channel("frames", "tool")[:]
        curve = HOME + [0.0, 0.0, PEDESTAL] + 1.5 * recording.arrays["curve"]
    distance = np.array([np.linalg.norm(curve - place, axis=1).min() for place in tool])
    alone = (t > 1.0) & (t < 4.4)
    assert distance[alone].max() < 2.0e-3  # the curve is drawn with a point every 2 mm
    assert distance[(t > 4.4) & (t < 6.0)].max() > 8.0e-3


@pytest.mark.slow
def test_arm_tracks_the_map_with_torque_margin(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text())["arm"]
    assert summary["tool_rms_mm"] < 0.2
    assert summary["tool_max_mm"] < 0.5
    assert summary["joints_rms_deg"] < 0.05
    assert summary["torque_share"] < 0.3
    assert summary["nearest_limit_deg"] > 20.0
    assert (folder / "report.html").exists()
    assert (folder / "figures" / "arm.png").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("without_region")
def test_arm_run_is_reproduced_exactly(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = load_config(folder / "config.json")
    assert replace(config, user=run_config().user) == resolved(run_config(map="robot-arm", seconds=8.0))
    assert config.user.does == "push"
    assert main(["reproduce", str(folder)]) == 0
    assert "bit for bit, over 8000 ticks" in capsys.readouterr().out
    page = (folder / "report.html").read_text(encoding="utf-8")
    (folder / "report.html").unlink()
    assert main(["report", str(folder)]) == 0
    assert (folder / "report.html").read_text(encoding="utf-8") == page
    assert main(["certify", str(folder), "--out", str(tmp_path / "certificate")]) == 0
    stdout = capsys.readouterr().out
    assert "stability: certified" in stdout
    assert "ballistic" not in stdout  # an arm plays no clip
    altered = tmp_path / "altered"
    shutil.copytree(folder, altered)
    with h5py.File(altered / "run.h5", "r+") as file:
        config = json.loads(file["config"][()])
        del file["config"]
        file["config"] = json.dumps(config | {"mode": config["mode"] | {"stiffness": 301.0}})
    assert main(["reproduce", str(altered)]) == 1
    assert "differs first at" in capsys.readouterr().out
    with h5py.File(altered / "run.h5", "r+") as file:
        del file["static/title"]
    assert main(["report", str(altered)]) == 2
    assert "recorded by another version of the program" in capsys.readouterr().err


@pytest.mark.slow
def test_weak_motor_saturates_and_is_reported() -> None:
    """With a tenth of the shoulder's torque the arm lags: tracking is not enforced kinematically."""
    session = wire(run_config(map="robot-arm", seconds=1.5))
    servo = session.servo
    assert isinstance(servo.figure, RobotState)
    servo.figure.torque_limit[1] = 10.0
    Loop(servo, session.world).run(0.5)
    assert abs(servo.figure.ctrl[1]) <= 10.0
    assert servo.figure.report[1] >= 1.0
    assert np.abs(servo.figure.qpos - servo.reference.pose).max() > 0.1


def test_invalid_arm_numbers_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for flags in (["--seconds", "0"], ["--figure-ticks", "0"], ["--radius", "0.5"], ["--lap", "nan"]):
        assert main(["run", "--map", "robot-arm", *flags, "--out", str(tmp_path / "run")]) == 2
        assert "Traceback" not in capsys.readouterr().err
        assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--figure kinematic", "a robot arm takes the figure's place; leave out --figure kinematic"),
        ("--stature 1.75", "--stature 1.75 has no meaning with a robot arm; it belongs to --figure physical,"),
        ("--blend 0.4", "--blend 0.4 has no meaning with a robot arm"),
        ("--clips walk", "--clips has no meaning with --mode follow --map robot-arm; it belongs to --map cylindrical"),
        ("--walls", "--walls is for a figure, and a robot arm is in its place"),
        ("--governor", "--governor is for a figure, and a robot arm is in its place"),
        ("--mode lead", "leave out --map robot-arm"),
        ("--scale -1", "--scale is -1; expected more than 0"),
        ("--scale 4", "expected --scale 2.2 or less, or a smaller curve"),
    ],
)
def test_options_inapplicable_to_an_arm_are_refused(
    words: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["run", "--map", "robot-arm", *words.split(), "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()
    assert main(["live", "--map", "robot-arm", "--out", str(out)]) == 2
    assert "the live page shows a figure" in capsys.readouterr().err
    assert main(["hardware", "run", "--device", "emulated", "--arm", "--map", "robot-arm", "--out", str(out)]) == 2
    assert "beside a device only figures are shown" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["bunny", "rivers", "stretch"])
def test_tool_follows_the_stylus_in_every_mode(mode: str) -> None:
    """By MuJoCo's own kinematics, the tool is where the stylus is, scaled; it lags by the filter between the two."""
    session = wire(run_config(mode, "robot-arm", seconds=4.0, figure_ticks=4))
    distances: list[np.ndarray] = []
    of_block = channels(session.servo, session.world)

    def keep(ticks: TickLog, frames: FrameLog, n: int) -> None:
        block = of_block(ticks, frames, n)
        tool = block["frames"]["tool"] - HOME - [0.0, 0.0, PEDESTAL]
        distances.append(np.linalg.norm(tool - 1.5 * block["ticks"]["p"][::4], axis=1))

    Loop(session.servo, session.world, keep).run(4.0)
    settled = np.concatenate(distances)[250:]
    assert 1e-6 < settled.max() < 4e-3


@pytest.mark.slow
def test_robot_arm_map_in_a_python_simulation(tmp_path: Path) -> None:
    """One's own law beside FOLLOW, with the tool at a smaller scale: recorded, stepped and drawn as any run."""
    curve = hvf.circle(radius=0.04, lap=4.0)

    @hvf.law
    def floor(hand: hvf.HandState, k: float = 500.0) -> tuple[float, float, float]:
        return 0.0, 0.0, max(0.0, -k * (hand.p[2] + 1e-3))

    arm = hvf.RobotArm(around=curve, scale=1.0)
    sim = hvf.Simulation(field=(hvf.Follow(curve, k_r=300, b_d=8) + floor).limited(8.0), haptic_map=arm)
    run = sim.run(2.5, record=tmp_path / "run")
    assert run.summary.arm is not None
    assert run.summary.arm.tool_rms_mm < 0.2
    assert run.summary.animation is None
    assert run.summary.figure is None
    tool = run.frames["tool"] - HOME - [0.0, 0.0, PEDESTAL]
    p = run.ticks["p"][:: round(len(run.ticks["p"]) / len(tool))]
    assert np.linalg.norm(tool - p, axis=1)[500:].max() < 4e-3  # scale 1.0, not the default 1.5
    assert np.linalg.norm(p[500:], axis=1).min() > 0.03
    tick = next(iter(sim))
    assert tick.pose.shape == tick.figure.shape == (7,)
    with pytest.raises(hvf.SimError, match="no figure, and so no animation"):
        run.to_bvh(tmp_path / "edited.bvh")
    write_report_of(tmp_path / "run")
    assert "robot arm" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_figure_numbers_with_a_robot_arm_map_are_refused_in_python() -> None:
    curve = hvf.circle(radius=0.04, lap=4.0)
    river = hvf.Follow(curve, k_r=300, b_d=8)
    for figure, message in ((hvf.Figure(kind="none"), "takes the figure's place"), (hvf.Figure(mass=60.0), "mass=60")):
        with pytest.raises(hvf.ParameterError, match=message):
            hvf.Simulation(field=river, haptic_map=hvf.RobotArm(around=curve), figure=figure)
    for name, value in (("scale", -1.0), ("reach", 0.0), ("scale", float("nan"))):
        with pytest.raises(hvf.ParameterError, match=f"{name} is"):
            hvf.RobotArm(**{"around": curve, name: value})
