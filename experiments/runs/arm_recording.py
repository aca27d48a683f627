"""Recording of a run of the robot arm: its channels, and the observer of the loop that appends them."""

from collections.abc import Callable

import mujoco
import numpy as np

from controllers.state import Array
from models.robot_arm.spec import ARM_JOINTS, TOOL
from models.world.scene import PEDESTAL, ROBOT
from sim.body.robot import REPORT_SATURATED
from sim.loop.loop import groups, tick_channels
from sim.loop.servo import FrameLog, Servo, TickLog
from sim.recording.recorder import Group, Recorder
from sim.world.robot_world import RobotWorld


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
