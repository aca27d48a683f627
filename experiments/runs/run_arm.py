"""Runs a configuration of the robot arm and writes its folder."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from rich.console import Console

from controllers.curves.trajectory import Trajectory
from experiments.config.part import to_dict, to_json
from experiments.config.run_config import ArmConfig
from experiments.console.compiling import compile_once
from experiments.console.estimates import check_length
from experiments.console.progress import simulating
from experiments.files.json_text import json_text
from experiments.results.folder import (
    CONFIG,
    RECORDING,
    REPORT,
    SUMMARY,
    arm_config_of,
    check_folder,
    check_holds,
    claimed,
)
from experiments.results.measures.arm_summary import ArmSummary, arm_summary
from experiments.results.pages.arm_figure import arm_figure
from experiments.results.pages.figures import STYLE
from experiments.results.pages.report import write_report
from experiments.results.pages.report_of import lines_of
from experiments.runs.arm_recording import arm_groups, record_arm
from experiments.setups.robot_arm import HOME, SCALE, wire_arm
from models.phantom.parameters import PREMIUM_1_5
from models.world.scene import P_WH, ROBOT
from sim.loop.loop import Loop
from sim.loop.servo import Servo
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.viewer.replay_html import Target
from sim.world.robot_world import RobotWorld

FIGURE = "arm.png"
_TARGET = Target(ROBOT, "robot arm", "h(p, R)", 1.6)


def run_arm(config: ArmConfig, out: Path, overwrite: bool) -> ArmSummary:
    """Run, and write recording, configuration, summary, figure and page into a folder.

    Raises
    ------
    ModelError, ControllerError, SimError
        If something about the configuration or the folder is wrong; the folder is then left unchanged.
    """
    console = Console(stderr=True)
    check_folder(out, overwrite)
    check_length(out, config.seconds, config.clock.servo_period)
    servo, world, curve = wire_arm(config, lambda units: compile_once(console, units))
    with claimed(out):
        check_holds(out, overwrite)
        for name in (RECORDING, SUMMARY, REPORT, CONFIG, FIGURE):
            (out / name).unlink(missing_ok=True)
        (out / CONFIG).write_text(to_json(config), encoding="utf-8")
        summary = _recorded(config, servo, world, curve, out, console)
        (out / SUMMARY).write_text(json_text(summary) + "\n", encoding="utf-8")
        write_arm_report(out, world, summary.lines())
    console.print(f"Written to {out}: {REPORT} (open it in a browser), {SUMMARY}, {RECORDING}.")
    return summary


def write_arm_report(folder: Path, world: RobotWorld, lines: Sequence[str]) -> None:
    """Draw the figure and the page of a run of the arm from its recording; `lines` are its summary in words."""
    with Recording(folder / RECORDING) as recording:
        with mpl.rc_context(STYLE):
            arm_figure(recording, HOME, SCALE).savefig(folder / FIGURE, dpi=150)
        title = "FOLLOW leads a robot arm"
        write_report(folder / REPORT, recording, world.model, title, list(lines), [folder / FIGURE], _TARGET)


def finish_arm(folder: Path) -> None:
    """Draw figure and page of a run of the arm again; of an interrupted run the page says how much is recorded."""
    with Recording(folder / RECORDING) as recording:
        config, lines = arm_config_of(recording), lines_of(recording, folder)
    write_arm_report(folder, wire_arm(config)[1], lines)


def _recorded(
    config: ArmConfig, servo: Servo, world: RobotWorld, curve: Trajectory, out: Path, console: Console
) -> ArmSummary:
    """Run and record; returns the summary."""
    static: dict[str, npt.ArrayLike | str] = {
        "curve": curve.point(np.linspace(curve.start, curve.end, 241)), "tube_radius": 0.02, "p_WH": P_WH,
        "motor_continuous": np.array(PREMIUM_1_5.continuous_torque),
    }  # fmt: skip
    with Recorder(out / RECORDING, to_dict(config), config.seed, arm_groups(servo), static) as recorder:
        loop, first = Loop(servo, world, record_arm(recorder, servo, world)), servo.plant.period * config.arm_ticks
        loop.run(first)
        with simulating(console, config.seconds) as reached:
            times = loop.run(config.seconds - first, reached)
        recorder.flush()
        with Recording(out / RECORDING) as recording:
            summary = arm_summary(recording, world.arm, config, times.real_time_factor)
        recorder.close(asdict(summary) | {"lines": summary.lines()})
    return summary
