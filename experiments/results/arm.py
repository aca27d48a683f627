"""Results of a run of the robot arm: recorded channels, measures, summary in words, figure."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.figure import Figure

from controllers.state import Array
from experiments.config.run_config import ArmConfig
from experiments.results.oscillation import OscillationSummary, oscillation_summary
from models.robot_arm.spec import ARM_JOINTS, TOOL, arm_limits
from models.world.scene import PEDESTAL, ROBOT
from sim.body.robot import REPORT_SATURATED
from sim.loop.loop import groups, tick_channels
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.viewer.palette import CURVE, FIELD, USER
from sim.world.robot_world import RobotWorld


@dataclass(frozen=True)
class ArmSummary:
    """Measures of a run of the robot arm.

    Attributes
    ----------
    laps : float
    deviation_rms_mm : float
        RMS distance of the stylus from the curve; the first second, the pushes and a second after each are left out.
    tool_rms_mm, tool_max_mm : float
        Distance of the arm's end effector from where the stylus leads it; the first second is left out.
    joints_rms_deg : float
        RMS difference of the joint angles from h(p, R); the first second is left out.
    torque_share : float
        Largest ratio of a torque to the limit of its motor.
    nearest_limit_deg : float
        Least distance of a joint from its limit.
    real_time_factor : float
    oscillation : OscillationSummary
        Measured stability of the loop.
    """

    laps: float
    deviation_rms_mm: float
    tool_rms_mm: float
    tool_max_mm: float
    joints_rms_deg: float
    torque_share: float
    nearest_limit_deg: float
    real_time_factor: float
    oscillation: OscillationSummary

    def lines(self) -> list[str]:
        """Measures in words, one sentence per line."""
        return [
            *self.oscillation.lines(),
            f"The stylus ran {self.laps:.2f} laps, {self.deviation_rms_mm:.2f} mm RMS from the curve when left alone.",
            f"The tool was {self.tool_rms_mm:.2f} mm RMS, at most {self.tool_max_mm:.2f} mm, from where the stylus "
            f"leads it; the joints {self.joints_rms_deg:.3f}° RMS from h.",
            f"The motors gave at most {100 * self.torque_share:.0f} % of their torque, and no joint came nearer to its "
            f"limit than {self.nearest_limit_deg:.0f}°.",
            f"It ran at {self.real_time_factor:.2f} × real time.",
        ]


def arm_groups(servo: Servo) -> dict[str, Group]:
    """Recorded channels: ``ticks`` as in every run, ``frames`` with joint angles [rad] and tool positions [m]."""
    every = groups(servo)
    ticks = {name: shape for name, shape in every["ticks"].channels.items() if name != "residual"}
    n = len(ARM_JOINTS)
    frames = {
        "t": (), "qpos": every["frames"].channels["qpos"], "reference": (n,), "joints": (n,), "tool": (3,),
        "led": (3,), "saturated": (),
    }  # fmt: skip
    return {"ticks": Group(every["ticks"].rate, ticks), "frames": Group(every["frames"].rate, frames)}


def arm_channels(servo: Servo, world: RobotWorld) -> Callable[[TickLog, FrameLog, int], dict[str, dict[str, Array]]]:
    """A function that gives the channels of `arm_groups` of a block of n ticks."""
    first = int(world.model.joint(ROBOT + ARM_JOINTS[0]).qposadr[0])
    data = mujoco.MjData(world.arm)

    def tools(angles: Array) -> Array:
        places = np.empty((len(angles), 3))
        for i, q in enumerate(angles):
            data.qpos[:] = q
            mujoco.mj_kinematics(world.arm, data)
            places[i] = data.site(TOOL).xpos
        places[:, 2] += PEDESTAL
        return places

    def channels(ticks: TickLog, frames: FrameLog, n: int) -> dict[str, dict[str, Array]]:
        of_ticks, m = tick_channels(ticks, n), -(-n // servo.figure_ticks)
        del of_ticks["residual"]
        joints, reference = frames.qpos[:m, first : first + len(ARM_JOINTS)], frames.reference[:m]
        of_frames = {
            "t": frames.t[:m], "qpos": frames.qpos[:m], "reference": reference, "joints": joints,
            "tool": tools(joints), "led": tools(reference), "saturated": frames.report[:m, REPORT_SATURATED],
        }  # fmt: skip
        return {"ticks": of_ticks, "frames": of_frames}

    return channels


def record_arm(recorder: Recorder, servo: Servo, world: RobotWorld) -> Callable[[TickLog, FrameLog, int], None]:
    """An observer that appends every block to a recorder made with `arm_groups`."""
    channels = arm_channels(servo, world)

    def observe(ticks: TickLog, frames: FrameLog, n: int) -> None:
        for group, block in channels(ticks, frames, n).items():
            recorder.append(group, block)

    return observe


def arm_summary(recording: Recording, arm: mujoco.MjModel, config: ArmConfig, speed: float) -> ArmSummary:
    """Measure a recording made with `arm_groups`."""
    t, distance, phase = (recording.channel("ticks", name)[:] for name in ("t", "distance", "phase"))
    work = np.linalg.norm(recording.channel("ticks", "user")[:], axis=1) > 1e-3
    last = np.maximum.accumulate(np.where(work, t, -np.inf))
    alone = (t >= 1.0) & (t - last > 1.0)
    steps = np.diff(phase)
    steps -= config.lap * np.round(steps / config.lap)
    settled = recording.channel("frames", "t")[:] >= 1.0
    tool, led, joints, reference = (
        recording.channel("frames", name)[:][settled] for name in ("tool", "led", "joints", "reference")
    )
    apart = 1e3 * np.linalg.norm(tool - led, axis=1)
    torque = np.abs(recording.channel("ticks", "ctrl")[:][:, -len(ARM_JOINTS) :])
    limits = arm_limits(arm)
    room = np.minimum(joints - limits[:, 0], limits[:, 1] - joints)
    return ArmSummary(
        laps=float(np.sum(steps)) / config.lap,
        deviation_rms_mm=1e3 * float(np.sqrt(np.mean(distance[alone] ** 2))) if alone.any() else float("nan"),
        tool_rms_mm=float(np.sqrt(np.mean(apart**2))),
        tool_max_mm=float(apart.max()),
        joints_rms_deg=float(np.degrees(np.sqrt(np.mean((joints - reference) ** 2)))),
        torque_share=float((torque / arm.actuator_ctrlrange[:, 1]).max()),
        nearest_limit_deg=float(np.degrees(room.min())),
        real_time_factor=speed,
        oscillation=oscillation_summary(recording),
    )


def arm_figure(recording: Recording, home: Array, scale: float) -> Figure:
    """Path of the tool over the scaled curve of the stylus, and the tracking error of the tool over time.

    The curve is scaled by `scale` about the home position of the tool [m].
    """
    t, tool, led = (recording.channel("frames", name)[:] for name in ("t", "tool", "led"))
    curve = home + [0.0, 0.0, PEDESTAL] + scale * recording.array("curve")
    ticks, user = recording.channel("ticks", "t")[:], recording.channel("ticks", "user")[:]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    path, error = figure.subplots(1, 2, width_ratios=(1, 1.6))
    path.plot(1e3 * tool[:, 1], 1e3 * tool[:, 2], color=FIELD, label="tool")
    path.plot(1e3 * curve[:, 1], 1e3 * curve[:, 2], color=CURVE, ls=(0, (4, 3)), lw=0.8, label="curve, scaled")
    path.set(xlabel="y [mm]", ylabel="z [mm]", title="tool, from the front", aspect="equal")
    path.legend()
    error.plot(t, 1e3 * np.linalg.norm(tool - led, axis=1), color=FIELD, label="tool from where it is led [mm]")
    error.plot(ticks, np.linalg.norm(user, axis=1), color=USER, label="force of the hand [N]")
    error.set(xlabel="time [s]", ylim=(0.0, None), title="tracking")
    error.legend()
    return figure
